//! Changing a path: away from obstacles, its tip onto a smooth curve, and against what bounding jerk does to its corners.

pub(crate) mod collision_correction;
mod corner_precompensation;
pub(crate) mod smooth_update;
pub(crate) mod tip_path;
mod tip_tracker;
