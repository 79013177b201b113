//! Thresholds of the state machine.

/// The loop attaches to a robot whose accepted reference is this near to the tendon lengths of a configuration, m.
pub const CONSISTENCY_M: f64 = 1e-6;

/// A robot state may be stamped this far in the future, ns: robot and loop read the same clock.
pub(crate) const STAMP_ALLOWANCE_NS: i64 = 1_000_000;

/// How long a robot may take to follow the first set-points, ns.
pub(crate) const ROBOT_REPLY_TIMEOUT_NS: i64 = 200_000_000;

/// Thresholds at which the state machine calls a cycle late, a peer lost, or a robot astray.
#[derive(Clone, Copy, Debug)]
pub struct ExecutiveSettings {
    /// Length of a cycle, ns. A cycle is late that comes more than 1.5 of these after the one before.
    pub period_ns: i64,
    /// Furthest step along a trajectory in one cycle, ns.
    pub step_cap_ns: i64,
    /// For how long cycles may come late one after the other before a motion is stopped, ns; each counts as the step cap at most.
    pub late_run_ns: i64,
    /// Cycle time without a new robot state at which the robot counts as lost, ns.
    pub robot_lost_ns: i64,
    /// Time constant of the tracking error's low pass, s.
    pub tracking_filter_s: f64,
    /// Tracking error allowed until a trajectory brings its own tolerance, and again after a reset, rad.
    pub hold_tolerance_rad: f64,
}

impl ExecutiveSettings {
    /// How far a robot's body may be from its reference where the loop attaches to it, rad.
    pub(crate) fn off_reference_limit_rad(&self) -> f64 {
        0.5 * self.hold_tolerance_rad
    }
}
