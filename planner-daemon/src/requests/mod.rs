//! A plan request from its reception to its answer: validation, queue, planning, report.

mod answer;
mod fair_queue;
mod plan_runner;
mod recent_plans;
mod refusal;
mod report;
mod request_validator;
mod service;
mod wait_mode;

pub(crate) use plan_runner::PlanRunner;
#[cfg(test)]
pub(crate) use request_validator::PlanTask;
pub(crate) use request_validator::RequestValidator;
pub(crate) use service::Service;
pub use wait_mode::WaitMode;
