//! The goal that stays: where the robot is kept on its way to.
//!
//! ```text
//!  Planning ──▶ Underway ──▶ Reached        a goal that moves, and something better, are planned for while it is under way
//!      ▲            │           │
//!      └─ Unreachable, RobotNotReady        tried again
//!                   ▼
//!                 Ended                     withdrawn, replaced, stopped, in fault: only another goal moves the robot again
//! ```

mod goal_keeper;
mod kept_goal;
mod moving_target;
mod ports;
mod target_motion;

pub(crate) use goal_keeper::{GoalKeeper, PlanResult, Wanted};
pub(crate) use kept_goal::PublishedMotion;
pub(crate) use ports::GoalPorts;
