//! The settings of execution.

use std::time::Duration;

use pcc_model::UnitRobot;
use trajectory::{RateLaw, Trajectory};

/// Time from a reason to stop until the controller brakes, s: its state is up to 20 ms old, and the order has to arrive.
pub(super) const ORDER_DELAY_S: f64 = 0.05;

/// The settings of execution: robot, tolerance, braking, lead time.
#[derive(Clone, Debug)]
pub(crate) struct ExecutionRules {
    /// Hash of the robot file.
    pub(crate) robot_hash: u64,
    /// The robot in units of its section length, its tubes padded by what covers the path tolerance.
    pub(crate) padded: UnitRobot,
    /// Tracking error that the certificate covers, rad in each bending pair.
    pub(crate) path_tolerance_rad: f64,
    /// The controller's law of braking, by which stopping times are predicted.
    pub(crate) rate_law: RateLaw,
    /// Least time between publishing and begin.
    pub(crate) begin_lead: Duration,
    /// Whether nothing may be executed without a live scene.
    pub(crate) scene_expected: bool,
}

impl ExecutionRules {
    /// Longest stop on a motion, with the time until it begins, s.
    pub(crate) fn stopping_s(&self, motion: &Trajectory) -> f64 {
        self.rate_law.longest_stop(motion.knots()) + ORDER_DELAY_S
    }
}
