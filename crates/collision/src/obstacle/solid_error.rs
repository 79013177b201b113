//! Why numbers do not make a solid.

use crate::obstacle::limits::{MAX_EXTENT, MAX_TRIANGLES, MIN_EXTENT};
use crate::obstacle::voxel_grid::VoxelError;
use thiserror::Error;

/// Why numbers do not make a solid.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum SolidError {
    /// A length is not usable.
    #[error("{what} is {value}; {MIN_EXTENT:e} to {MAX_EXTENT:e} section lengths are allowed")]
    Length {
        /// Name of the length: `a side`.
        what: &'static str,
        /// The refused value.
        value: f64,
    },
    /// A coordinate is not usable.
    #[error("{what} is {value}; within ±{MAX_EXTENT:e} section lengths is allowed")]
    Coordinate {
        /// What has the coordinate: `a vertex`.
        what: &'static str,
        /// The refused value.
        value: f64,
    },
    /// There is no triangle, or there are too many.
    #[error("the mesh has {count} triangles; 1 to {MAX_TRIANGLES} are allowed")]
    Triangles {
        /// Number of triangles.
        count: usize,
    },
    /// A triangle names a vertex that is not there.
    #[error("triangle {triangle} has a vertex {vertex} of {vertices}")]
    Vertex {
        /// Index of the triangle.
        triangle: usize,
        /// Index of the vertex.
        vertex: u32,
        /// Number of vertices.
        vertices: usize,
    },
    /// An edge does not have exactly one triangle on each side, each seeing it the other way round.
    #[error(
        "the mesh is open, or its triangles do not all face the same side: the `edge` from {from:?} to {to:?} needs exactly one triangle on each side"
    )]
    Open {
        /// Where the edge begins.
        from: [f64; 3],
        /// Where it ends.
        to: [f64; 3],
    },
    /// The triangles face inwards.
    #[error(
        "the mesh is inside out: its triangles enclose a volume of {volume}, counter-clockwise as seen from outside is needed"
    )]
    InsideOut {
        /// Signed volume that the triangles enclose.
        volume: f64,
    },
    /// The voxels do not make a solid.
    #[error(transparent)]
    Voxels(#[from] VoxelError),
}
