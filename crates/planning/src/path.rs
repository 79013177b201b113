//! Paths of 64 waypoints: straight ones, smooth changes of them, smoothing, and figures.

pub(crate) mod cholesky;
pub(crate) mod metrics;
pub(crate) mod sine_basis;
pub(crate) mod smooth_least_squares;
pub(crate) mod smoothing_spline;
pub(crate) mod waypoints;
