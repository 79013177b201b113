//! Settings of the paper's generator that a data set names.

/// Largest step between neighbouring waypoints of a path that [`crate::generate_paper_block`] keeps, rad.
pub const LARGEST_STEP: f64 = 0.4;

/// Gain of the descent of Σ‖ζ_{h+1} − ζ_h‖² in the null space of the tip.
pub(crate) const CONTINUITY: f64 = 0.1;
