//! Why the controller refuses a trajectory.

use shared_types::{
    codes::{LoopState, Refusal},
    valid::Invalid,
};
use trajectory::TrajectoryError;

/// A trajectory may start this far from the commanded configuration, rad; the difference is kept as an offset.
pub const START_TOLERANCE_RAD: f64 = 1e-6;

/// Excess over the bending limit that certified motions may have, rad.
pub(super) const BENDING_TOLERANCE_RAD: f64 = 5e-3;

/// Why a trajectory is not executed.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum TrajectoryRefusal {
    /// The loop is not holding, or for a motion that leaves another one not executing.
    #[error(
        "the controller is {0}; a trajectory that begins at rest is taken only while it is holding, one that leaves another only while \
         it is executing"
    )]
    State(LoopState),
    /// Another trajectory is waiting for its begin.
    #[error("another trajectory is waiting for its begin")]
    Waiting,
    /// It leaves a trajectory that is not the one that is executed.
    #[error("it leaves another trajectory than the one that is executed")]
    LeavesAnother,
    /// The place where it leaves the other trajectory is passed.
    #[error(
        "the place where it leaves the trajectory that is executed was passed {late_s:.4} s ago"
    )]
    SwitchMissed {
        /// How much path time ago.
        late_s: f64,
    },
    /// The place where it leaves the other trajectory is too near to a knot of that, or not on it.
    #[error(
        "the place where it leaves the trajectory that is executed is at one of its knots or not on it"
    )]
    SwitchAtKnot,
    /// It does not begin in the state in which the other trajectory is where it leaves it.
    #[error(
        "it is {error:.1e} away from the trajectory that it leaves, in rad, rad/s or rad/s²; 1e-9 are allowed"
    )]
    Discontinuous {
        /// The largest difference of position, velocity or acceleration.
        error: f64,
    },
    /// The daemon gives no sign of life.
    #[error("the daemon that sent it gives no sign of life")]
    DaemonSilent,
    /// The trajectory was meant for a controller before this one.
    #[error("it is meant for another controller than this one, which was started since")]
    OtherController,
    /// It is planned for another robot.
    #[error(
        "it is of the robot {found:016x}, this controller's is {expected:016x}: their robot files differ"
    )]
    OtherRobot {
        /// Hash of the robot that it is planned for.
        found: u64,
        /// Hash of the controller's robot.
        expected: u64,
    },
    /// Another daemon than the one whose heart beats has published it.
    #[error(
        "it was published by another daemon than the one whose heart beats: nobody would watch over it"
    )]
    OtherDaemon,
    /// The trajectory was taken, and given up before its begin.
    #[error(
        "it was set aside before its begin: a stop, a reset, a fault or the loss of robot or daemon came first"
    )]
    SetAside,
    /// A stop or a reset was ordered, or the controller was started, after the trajectory was requested.
    #[error(
        "it was requested {before_ms:.1} ms before a stop or a reset was ordered or the controller was started"
    )]
    RequestedBefore {
        /// How long before the stop, the reset or the start it was requested, ms.
        before_ms: f64,
    },
    /// The request's stamp is of the future, so that no stop could be later.
    #[error("it was requested {ahead_ms:.1} ms from now: its stamp is not of CLOCK_MONOTONIC")]
    FromTheFuture {
        /// How far in the future the request is stamped, ms.
        ahead_ms: f64,
    },
    /// A field of the message is wrong.
    #[error(transparent)]
    Invalid(#[from] Invalid),
    /// The trajectory was taken before.
    #[error("trajectory {0} with this begin was taken before")]
    OldId(u32),
    /// The trajectory begins in the past.
    #[error("it begins {late_ms:.1} ms in the past, {allowed_ms:.1} ms are allowed")]
    Past {
        /// How far in the past the trajectory begins, ms.
        late_ms: f64,
        /// How far in the past a begin may be, ms.
        allowed_ms: f64,
    },
    /// The trajectory begins too far in the future.
    #[error("it begins {ahead_s:.1} s from now, {allowed_s:.1} s are allowed")]
    Ahead {
        /// How far in the future the trajectory begins, s.
        ahead_s: f64,
        /// How far in the future a begin may be, s.
        allowed_s: f64,
    },
    /// The first knot is not the commanded configuration.
    #[error(
        "it starts {distance_rad:.2e} rad from the commanded configuration, {START_TOLERANCE_RAD:.0e} are allowed"
    )]
    Start {
        /// Distance of the first knot from the commanded configuration, rad.
        distance_rad: f64,
    },
    /// An end is not at rest.
    #[error("it does not {0} at rest")]
    InMotion(&'static str),
    /// The knots are no motion.
    #[error("it is no motion: {0}")]
    NoMotion(#[from] TrajectoryError),
    /// The motion exceeds a tendon limit.
    #[error("it uses {share:.6} of the tendons' {limit} limit")]
    Tendons {
        /// The limit exceeded: velocity, acceleration or jerk.
        limit: &'static str,
        /// The motion's largest use of the limit, ÷ the limit.
        share: f64,
    },
    /// The motion bends a section too far.
    #[error(
        "it bends a section {excess_rad:.4} rad over its limit, {BENDING_TOLERANCE_RAD} are allowed"
    )]
    Bending {
        /// Excess over the section's bending limit, rad.
        excess_rad: f64,
    },
}

impl TrajectoryRefusal {
    /// The reason as a code in the controller's state.
    #[must_use]
    pub fn code(&self) -> Refusal {
        match self {
            Self::State(LoopState::Starting) | Self::DaemonSilent => Refusal::NotReady,
            Self::State(LoopState::Fault) => Refusal::Faulted,
            Self::State(_) | Self::Waiting => Refusal::Busy,
            Self::Invalid(invalid) if invalid.field == "protocol_version" => Refusal::WrongVersion,
            Self::OtherController => Refusal::OtherController,
            Self::OtherRobot { .. } => Refusal::OtherRobot,
            Self::OtherDaemon => Refusal::OtherDaemon,
            Self::RequestedBefore { .. } => Refusal::RequestedBefore,
            Self::SetAside => Refusal::SetAside,
            Self::OldId(_) => Refusal::OldId,
            Self::Past { .. } => Refusal::BeginsInThePast,
            Self::Ahead { .. } => Refusal::BeginsTooLate,
            Self::LeavesAnother => Refusal::LeavesAnother,
            Self::SwitchMissed { .. } => Refusal::SwitchMissed,
            Self::SwitchAtKnot => Refusal::SwitchAtKnot,
            Self::Discontinuous { .. } => Refusal::Discontinuous,
            Self::Start { .. } | Self::InMotion("begin") => Refusal::StartsElsewhere,
            Self::InMotion(_) => Refusal::EndsInMotion,
            Self::Invalid(_) | Self::NoMotion(_) | Self::FromTheFuture { .. } => Refusal::Malformed,
            Self::Tendons { .. } | Self::Bending { .. } => Refusal::OutOfLimits,
        }
    }
}
