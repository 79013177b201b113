//! The limits that set-points are checked against, and the results.

use std::time::Duration;

use pcc_model::Robot;
use shared_types::codes::MotorState;

use crate::tendon_vector::TendonVector;

/// Factor on the robot's limits up to which set-points are accepted: rounding is no fault.
const USUAL_ALLOWANCE: f64 = 1.05;
/// Time without a set-point after which a robot ramps to rest, ns.
const USUAL_LOST_AFTER_NS: i64 = 20_000_000;
/// The most that a short cycle counts, ns.
const SHORT_CYCLE_NS: i64 = 5_000_000;

/// Limits of the reference, for each tendon.
#[derive(Clone, Copy, Debug)]
pub struct ReferenceLimits {
    /// Velocity limit, m/s.
    pub velocity_m_s: f64,
    /// Acceleration limit, m/s²; the ramp to rest uses exactly this.
    pub acceleration_m_s2: f64,
    /// Factor on both limits up to which a set-point is accepted.
    pub allowance: f64,
    /// Time without a set-point after which the ramp to rest begins, ns.
    pub lost_after_ns: i64,
    /// The most that one cycle counts, ns, unless the last eight were longer: a longer one is a pause of the whole machine or of the driver.
    pub longest_cycle_ns: i64,
}

impl ReferenceLimits {
    /// The limits of a robot file, for cycles of this length; set-points are accepted up to 1.05 of the limits, and lost after 20 ms.
    #[must_use]
    pub fn of(robot: &Robot, period: Duration) -> Self {
        Self {
            velocity_m_s: robot.tendon_limits.velocity,
            acceleration_m_s2: robot.tendon_limits.acceleration,
            allowance: USUAL_ALLOWANCE,
            lost_after_ns: USUAL_LOST_AFTER_NS,
            longest_cycle_ns: longest_cycle_ns(period),
        }
    }
}

/// The most that a cycle of this length counts, ns: two of them, 5 ms at least.
#[must_use]
pub fn longest_cycle_ns(period: Duration) -> i64 {
    (2 * period.as_nanos() as i64).max(SHORT_CYCLE_NS)
}

/// Where tendons are, and how they move; by default at rest in the straight robot.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TendonState {
    /// Lengths relative to the straight robot, m.
    pub position_m: TendonVector,
    /// Rates of the lengths, m/s.
    pub velocity_m_s: TendonVector,
}

/// What motors are to do in a cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotorTargets {
    /// Time for which this is, ns of CLOCK_MONOTONIC.
    pub stamp_ns: i64,
    /// Tendon lengths relative to the straight robot, m.
    pub position_m: TendonVector,
    /// Rates of the lengths, m/s.
    pub velocity_m_s: TendonVector,
    /// Accelerations of the lengths, m/s².
    pub acceleration_m_s2: TendonVector,
}

impl MotorTargets {
    /// Positions and velocities alone.
    #[must_use]
    pub fn state(&self) -> TendonState {
        TendonState {
            position_m: self.position_m,
            velocity_m_s: self.velocity_m_s,
        }
    }
}

/// Whether the reference follows set-points, ramps to rest, or rests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Never commanded.
    Idle,
    /// Following set-points.
    Following,
    /// Ramping to rest by itself: [`crate::Reference::ramps_to_rest`] says when.
    Ramping,
    /// At rest after a ramp to rest.
    AtRestAfterLoss,
    /// A set-point was refused while following: ramping to rest, or at rest.
    Fault(Refusal),
}

impl From<Mode> for MotorState {
    fn from(mode: Mode) -> Self {
        match mode {
            Mode::Idle => Self::Idle,
            Mode::Following => Self::Following,
            Mode::Ramping => Self::RampingToRest,
            Mode::AtRestAfterLoss => Self::AtRestAfterLoss,
            Mode::Fault(_) => Self::Fault,
        }
    }
}

/// Why a set-point was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// A number is NaN or infinite.
    #[error("a number in the set-point is not finite")]
    NotFinite,
    /// The set-point's stamp is in the future, not after the last one, or (the first one's) older than the time for a loss.
    #[error(
        "its stamp is not between the last accepted set-point's and now, or the first one is not fresh"
    )]
    Stamp,
    /// The set-point is further from the reference than the velocity limit allows.
    #[error("its position is further from the reference than the velocity limit allows")]
    PositionStep,
    /// The set-point's velocity is over the limit.
    #[error("its velocity is over the limit")]
    Velocity,
    /// The set-point's velocity differs from the reference's by more than the acceleration limit allows.
    #[error("its velocity differs from the last by more than the acceleration limit allows")]
    VelocityStep,
    /// The set-point's acceleration is over the limit.
    #[error("its acceleration is over the limit")]
    Acceleration,
    /// The robot is ramping to rest or in fault.
    #[error("the robot is not at rest yet after a loss or a fault")]
    NotAtRest,
}
