//! A plan request from its reception to its answer: validation, queue, planning, report.

mod answer;
mod asker;
mod fair_queue;
mod goal_exchange;
mod goal_turn;
mod idle_warm_up;
mod in_flight;
mod late_switch;
mod lead_times;
mod motion_turn;
mod plan_records;
mod plan_runner;
mod planned;
mod planned_execution;
mod planner_kind;
mod planning_turn;
mod planning_worker;
mod recent_plans;
mod refusal;
mod report;
mod request_validator;
mod robot_start;
mod service;
mod stored_plan;
mod verdict;
mod wait_mode;
mod worker_processors;

pub(crate) use lead_times::{LeadTimes, PlanKind, Work};
pub(crate) use plan_runner::PlanRunner;
pub use planner_kind::PlannerKind;
pub(crate) use request_validator::RequestValidator;
#[cfg(test)]
pub(crate) use request_validator::{MostKnots, PlanTask};
pub(crate) use service::Service;
pub use wait_mode::WaitMode;
