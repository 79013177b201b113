//! How finely waypoints become a motion.

/// The most knots that a motion may have.
pub const MAX_KNOTS: usize = 256;

/// How finely [`parameterize`](crate::parameterize) works.
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
