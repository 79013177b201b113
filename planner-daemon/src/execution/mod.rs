//! Handing motions over for execution: what is refused, and the way to the thread that publishes and supervises.

mod controller_check;
mod handle;
mod refusal;
mod request;
mod rules;
mod trajectory_id;

pub(crate) use controller_check::check_controller;
pub(crate) use handle::Execution;
pub(crate) use refusal::ExecutionRefusal;
pub(crate) use request::{Handed, Selected};
pub(crate) use rules::ExecutionRules;
pub(crate) use trajectory_id::next_id;
