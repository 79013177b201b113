//! A motion as a curve: knots, quintic segments, and the spline through waypoints.

pub(crate) mod knot;
mod knot_hash;
mod moved_end;
pub(crate) mod segment;
pub(crate) mod spline;
pub(crate) mod trajectory;
