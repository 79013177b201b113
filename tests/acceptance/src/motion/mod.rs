//! Motions that are joined while the robot moves, and motions through several goals: no stop to change its mind or on the way, nothing
//! that steps, no limit exceeded, no goal lost, and a result of every motion.

mod disturbed;
mod fault_resets;
mod faults;
mod figures;
mod goal_latency;
mod joins;
mod latency;
mod moving_balls;
mod moving_goal;
mod paths;
mod queue;
mod queue_figures;
mod queue_run;
mod queues;
mod replan_run;
mod routes;
mod setpoints;
mod standing;
mod unreachable_goal;
mod windows;

use crate::demo;
use crate::report::Report;
use crate::scale::Scale;

/// The suite's groups, in this order.
pub(crate) const GROUPS: &[fn(&mut Report, Scale)] = &[
    joins::run,
    routes::run,
    queues::run,
    latency::run,
    goal_latency::run,
    disturbed::run,
    faults::run,
    moving_goal::run,
    unreachable_goal::run,
    moving_balls::run,
    demo::run,
];
