//! The execution of motions: what is refused, publication for the controller, supervision until the end, orders to stop,
//! heartbeats.

mod active_time;
mod controller_check;
mod heartbeat;
mod joining;
mod later_stop;
mod publication;
mod refusal;
mod request;
mod robot_motion;
mod rules;
mod shared;
mod stop_order;
mod stop_reason;
mod supervised_motion;
mod supervision_thread;
mod supervisor;
mod trajectory_id;

pub use heartbeat::BackgroundError;
pub(crate) use heartbeat::BackgroundThreads;
pub(crate) use refusal::ExecutionRefusal;
pub(crate) use request::{ExecutionTiming, SelectedMotion};
pub(crate) use robot_motion::{FollowedMotion, RobotMotion, Switch, TimedGoal};
pub(crate) use rules::ExecutionRules;
pub(crate) use shared::Shared;
pub(crate) use stop_reason::StopReason;
pub(crate) use supervision_thread::{Execution, ExpectedBegin};
pub(crate) use supervisor::HeardOrders;
