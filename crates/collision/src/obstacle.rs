//! Obstacles: balls, capsules, boxes, closed meshes and voxel grids.

pub(crate) mod ball;
pub(crate) mod closed_mesh;
pub(crate) mod limits;
pub(crate) mod solid;
pub(crate) mod solid_error;
pub(crate) mod voxel_grid;
