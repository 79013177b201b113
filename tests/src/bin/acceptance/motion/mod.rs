//! Motions that are joined while the robot moves: no stop to change its mind, nothing that steps, no limit exceeded.

mod figures;
mod joins;
mod latency;
mod moving_balls;
mod moving_goal;
mod replan_run;
mod standing;
mod unreachable_goal;

use crate::report::Report;
use crate::scale::Scale;

/// The suite's groups, in this order.
pub(crate) const GROUPS: &[fn(&mut Report, Scale)] = &[
    joins::run,
    latency::run,
    moving_goal::run,
    unreachable_goal::run,
    moving_balls::run,
];
