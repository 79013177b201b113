//! Voxel grids: which cells are filled, and the surface between filled and empty ones.

use crate::obstacle::limits::{MAX_CELLS, MAX_EXTENT, MAX_TRIANGLES, MIN_EXTENT};
use glam::DVec3;
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::query::PointQuery;
use parry3d_f64::shape::TriMesh;
use thiserror::Error;

/// A grid of cells, filled or empty.
#[derive(Clone, Debug, PartialEq)]
pub struct VoxelGrid {
    /// Cells along x, y and z.
    pub counts: [usize; 3],
    /// Side of a cell.
    pub cell: f64,
    /// Whether each cell is filled; z runs fastest, x slowest.
    pub filled: Vec<bool>,
}

/// Why numbers do not make a grid.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum VoxelError {
    /// Too many cells, or not as many as the counts say.
    #[error(
        "{counts:?} voxels with {given} values; one value each and at most {MAX_CELLS} are allowed"
    )]
    Cells {
        /// Cells along x, y and z.
        counts: [usize; 3],
        /// Number of values given.
        given: usize,
    },
    /// The side of a cell is not usable.
    #[error(
        "the side of a voxel, voxel_m, is {0}; at least {MIN_EXTENT:e} section lengths, and at most {MAX_EXTENT:e} over the whole grid, is allowed"
    )]
    Side(f64),
    /// No cell is filled, or the surface is too large.
    #[error("the voxels have {count} faces; 1 to {} are allowed", MAX_TRIANGLES / 2)]
    Faces {
        /// Number of faces between a filled and an empty cell.
        count: usize,
    },
}

/// A grid with its surface.
#[derive(Clone, Debug)]
pub(crate) struct Voxels {
    grid: VoxelGrid,
    surface: TriMesh,
}

impl Voxels {
    pub(crate) fn new(grid: VoxelGrid) -> Result<Self, VoxelError> {
        let [x, y, z] = grid.counts;
        let cells = x.checked_mul(y).and_then(|xy| xy.checked_mul(z));
        if cells != Some(grid.filled.len()) || grid.filled.len() > MAX_CELLS {
            return Err(VoxelError::Cells {
                counts: grid.counts,
                given: grid.filled.len(),
            });
        }
        let longest = x.max(y).max(z) as f64;
        if !(grid.cell >= MIN_EXTENT && grid.cell * longest <= MAX_EXTENT) {
            return Err(VoxelError::Side(grid.cell));
        }
        let faces = grid.faces();
        let count = faces.len();
        if count == 0 || 2 * count > MAX_TRIANGLES {
            return Err(VoxelError::Faces { count });
        }
        let vertices = faces.into_iter().flatten().collect();
        let triangles = (0..count as u32).map(|i| 4 * i);
        let triangles = triangles.flat_map(|i| [[i, i + 1, i + 2], [i, i + 2, i + 3]]);
        let surface = TriMesh::new(vertices, triangles.collect());
        let surface = surface.map_err(|_| VoxelError::Faces { count })?;
        Ok(Self { grid, surface })
    }

    pub(crate) fn aabb(&self) -> Aabb {
        self.surface.local_aabb()
    }

    /// The surface's vertices, and triangles whose normals by the right-hand rule point out of the filled cells.
    pub(crate) fn surface(&self) -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let vertices = self.surface.vertices();
        let outward = |&[a, b, c]: &[u32; 3]| {
            let [p, q, r] = [a, b, c].map(|index| vertices[index as usize]);
            let normal = (q - p).cross(r - p).normalize();
            let beyond = (p + q + r) / 3.0 + normal * (0.5 * self.grid.cell);
            match self.is_inside(beyond) {
                true => [a, c, b],
                false => [a, b, c],
            }
        };
        let triangles = self.surface.indices().iter().map(outward).collect();
        (vertices.to_vec(), triangles)
    }

    fn is_inside(&self, point: DVec3) -> bool {
        let cell = (point / self.grid.cell).floor();
        let place = [cell.x, cell.y, cell.z].map(|v| v as i64);
        self.grid.is_filled(place)
    }

    /// The nearest point of the surface, and whether the point is in a filled cell.
    pub(crate) fn nearest(&self, point: DVec3) -> (DVec3, bool) {
        let nearest = self.surface.project_local_point(point, false).point;
        (nearest, self.is_inside(point))
    }
}

impl VoxelGrid {
    fn is_filled(&self, place: [i64; 3]) -> bool {
        let [nx, ny, nz] = self.counts.map(|n| n as i64);
        let [x, y, z] = place;
        let within = (0..nx).contains(&x) && (0..ny).contains(&y) && (0..nz).contains(&z);
        within && self.filled[((x * ny + y) * nz + z) as usize]
    }

    /// Corners of every face between a filled and an empty cell, in order around it.
    fn faces(&self) -> Vec<[DVec3; 4]> {
        let [nx, ny, nz] = self.counts.map(|n| n as i64);
        let places =
            (0..nx).flat_map(|x| (0..ny).flat_map(move |y| (0..nz).map(move |z| [x, y, z])));
        let mut faces = Vec::new();
        for place in places.filter(|place| self.is_filled(*place)) {
            for axis in 0..3 {
                for side in [0, 1] {
                    let mut neighbour = place;
                    neighbour[axis] += 2 * side - 1;
                    if !self.is_filled(neighbour) {
                        faces.push(self.face(place, axis, side));
                    }
                }
            }
        }
        faces
    }

    fn face(&self, place: [i64; 3], axis: usize, side: i64) -> [DVec3; 4] {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[a, b]| {
            let mut corner = place;
            corner[axis] += side;
            corner[u] += a;
            corner[v] += b;
            DVec3::from_array(corner.map(|c| c as f64)) * self.cell
        })
    }
}
