//! The limits that set-points are checked against, and the results.

use shared_types::codes::MotorState;

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
}

/// Whether the reference follows set-points, ramps to rest, or rests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Never commanded.
    Idle,
    /// Following set-points.
    Following,
    /// Ramping to rest after set-points stopped coming.
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
