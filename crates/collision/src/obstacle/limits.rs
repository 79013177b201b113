//! How large obstacles may be, and of how many parts.

/// Largest coordinate and radius of a ball, length unit: beyond it clearances lose more digits than a motion has room.
pub const MAX_EXTENT: f64 = 1e7;
/// Smallest side, radius of a capsule and voxel of a solid, length unit: below it products of lengths lose all digits.
pub(crate) const MIN_EXTENT: f64 = 1e-6;
/// Triangles that a mesh, or the surface of a voxel grid, may have.
pub const MAX_TRIANGLES: usize = 500_000;

/// Cells that a grid may have.
pub const MAX_CELLS: usize = 1 << 24;
