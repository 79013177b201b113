//! Points of a path at which its speed is planned.

/// A point of the grid that the speed is planned on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GridPoint {
    /// Spline piece that the interval after this point lies in.
    pub(crate) piece: usize,
    /// Path parameter s.
    pub(crate) parameter: f64,
}
