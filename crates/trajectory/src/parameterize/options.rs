//! How finely waypoints become a motion.

use pcc_model::TendonLimits;

/// The most knots that a motion may have.
pub const MAX_KNOTS: usize = 256;

/// How finely [`TimeParameterizer::parameterize`](crate::TimeParameterizer::parameterize) works.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParameterizationOptions {
    /// The most knots of the result, 4 to [`MAX_KNOTS`]. A quarter of them is laid evenly in time, the others where
    /// limits would be exceeded, so fewer may be used.
    pub knots: usize,
    /// About how many intervals the speed is planned on, at least 1 (more where limits would be exceeded).
    pub grid_intervals: usize,
    /// Polyline chords longer than this are divided, rad: the spline then stays closer to them (about 0.08 × this
    /// × the change of direction, as a vector difference, at a lone corner).
    pub spacing: f64,
}

impl Default for ParameterizationOptions {
    fn default() -> Self {
        Self {
            knots: 96,
            grid_intervals: 96,
            spacing: 0.1,
        }
    }
}

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
