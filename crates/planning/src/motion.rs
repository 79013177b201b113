//! From a path to a certified motion: constraints, correction and timing, and the fastest motion so far.

pub(crate) mod along_polyline;
pub(crate) mod among_moving_balls;
pub(crate) mod constraints;
pub(crate) mod duration_bound;
pub(crate) mod incumbent;
pub(crate) mod path_to_trajectory;
pub(crate) mod route_path;
pub(crate) mod through;
