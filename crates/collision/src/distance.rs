//! Distances between a section's backbone and obstacles.

pub(crate) mod arc_balls;
pub(crate) mod arc_solid;
pub(crate) mod ball_tree;
pub(crate) mod chosen_sections;
pub(crate) mod passage;
