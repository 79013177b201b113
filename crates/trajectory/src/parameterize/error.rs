//! Why waypoints cannot become a motion.

use crate::parameterize::options::{MAX_KNOTS, ParameterizationOptions};
use pcc_model::TendonLimits;

/// Why waypoints cannot become a motion.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ParameterizationError {
    /// No waypoint at all.
    #[error("a motion needs at least one waypoint")]
    NoWaypoints,
    /// A waypoint with NaN or an infinity, or so large that its norm overflows.
    #[error("waypoint {0} is not finite")]
    WaypointNotFinite(usize),
    /// A limit that is zero, negative or not finite.
    #[error("tendon limits must be finite and above zero, got {0:?}")]
    Limits(TendonLimits),
    /// A setting out of range.
    #[error(
        "parameterization options out of range (knots 4..={MAX_KNOTS}, grid_intervals ≥ 1, spacing > 0): {0:?}"
    )]
    Options(ParameterizationOptions),
    /// A velocity or acceleration at an end with NaN or an infinity, or so large that its norm overflows.
    #[error("the velocity or acceleration at the {0} is not finite")]
    EndNotFinite(End),
    /// An end that is faster, or accelerates more, than the limits allow.
    #[error(
        "the {end} uses {use_of_limit} of a tendon's velocity or acceleration limit; 1 is the most"
    )]
    EndExceeds {
        /// Which end.
        end: End,
        /// The larger of both uses.
        use_of_limit: f64,
    },
    /// The path cannot be begun or ended with this velocity: it turns too soon, or is too short to brake.
    #[error(
        "the path cannot be followed at {speed} rad/s at its {end}; {largest} rad/s is the most"
    )]
    NotControllable {
        /// Which end.
        end: End,
        /// The speed asked for, rad/s.
        speed: f64,
        /// The largest speed, rad/s; 0 if no speed is possible.
        largest: f64,
    },
    /// The limits leave no room for the state at an end: with its acceleration it must exceed one within its path.
    #[error("the motion would use {0} of a limit; 1 is the most")]
    NoRoom(f64),
    /// Times or their powers leave the range of f64.
    #[error("the path cannot be timed within f64's range under {0:?}")]
    NotTimeable(TendonLimits),
}

/// An end of a motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// Where it begins.
    Start,
    /// Where it ends.
    Finish,
}

impl std::fmt::Display for End {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str(match self {
            Self::Start => "start",
            Self::Finish => "end",
        })
    }
}
