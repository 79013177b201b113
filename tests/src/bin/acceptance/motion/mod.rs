//! Motions that are joined while the robot moves: no stop to change its mind, nothing that steps, no limit exceeded.

mod disturbed;
mod faults;
mod figures;
mod joins;
mod latency;
mod paths;
mod replan_run;

use crate::report::Report;
use crate::scale::Scale;

/// The suite's groups, in this order.
pub(crate) const GROUPS: &[fn(&mut Report, Scale)] =
    &[joins::run, latency::run, disturbed::run, faults::run];
