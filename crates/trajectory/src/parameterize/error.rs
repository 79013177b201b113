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
    /// Times or their powers leave the range of f64.
    #[error("the path cannot be timed within f64's range under {0:?}")]
    NotTimeable(TendonLimits),
}
