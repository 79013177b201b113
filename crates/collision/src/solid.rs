//! Solid obstacles through parry: capsules, boxes, closed meshes, voxel grids.

use crate::scene::{MAX_EXTENT, MIN_EXTENT};
use crate::voxels::{VoxelError, VoxelGrid, Voxels};
use glam::{DQuat, DVec3};
use nalgebra::Isometry3;
use parry3d_f64::math::Pose3;
use parry3d_f64::query::PointQuery;
use parry3d_f64::shape::{Capsule, Cuboid, TriMesh, TriMeshFlags};
use pcc_model::Point;
use std::collections::{HashMap, HashSet};
use thiserror::Error;

/// Triangles that a mesh, or the surface of a voxel grid, may have.
pub const MAX_TRIANGLES: usize = 500_000;

/// Why numbers do not make a solid.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum SolidError {
    /// A length is not usable.
    #[error("{what} is {value}; {MIN_EXTENT:e} to {MAX_EXTENT:e} section lengths are allowed")]
    Length {
        /// Which one.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// A coordinate is not usable.
    #[error("{what} is {value}; within ±{MAX_EXTENT:e} section lengths is allowed")]
    Coordinate {
        /// Of what.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// There is no triangle, or there are too many.
    #[error("the mesh has {count} triangles; 1 to {MAX_TRIANGLES} are allowed")]
    Triangles {
        /// How many.
        count: usize,
    },
    /// A triangle names a vertex that is not there.
    #[error("triangle {triangle} has a vertex {vertex} of {vertices}")]
    Vertex {
        /// Index of the triangle.
        triangle: usize,
        /// Index of the vertex.
        vertex: u32,
        /// How many there are.
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
        /// Signed volume.
        volume: f64,
    },
    /// The voxels.
    #[error(transparent)]
    Voxels(#[from] VoxelError),
}

#[derive(Clone, Debug)]
enum Shape {
    Capsule(Capsule),
    Cuboid(Cuboid),
    Mesh(Box<TriMesh>),
    Voxels(Box<Voxels>),
}

/// A solid obstacle at rest; its inside counts.
#[derive(Clone, Debug)]
pub struct Solid {
    shape: Shape,
    pose: Pose3,
    /// Of a ball around it, base frame.
    centre: Point,
    radius: f64,
}

/// The nearest point of a solid's surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Distance to it; negative inside.
    pub distance: f64,
    /// The point, base frame.
    pub point: Point,
    /// Unit vector that leads away from the solid, base frame.
    pub away: Point,
}

impl Solid {
    /// All points within `radius` of the segment between two points, base frame.
    ///
    /// # Errors
    /// [`SolidError::Coordinate`] or [`SolidError::Length`].
    pub fn capsule(ends: [Point; 2], radius: f64) -> Result<Self, SolidError> {
        ends.iter().try_for_each(|end| coordinates("an end", end))?;
        length("the radius", radius)?;
        let [a, b] = ends.map(DVec3::from);
        Ok(Self::new(
            Shape::Capsule(Capsule::new(a, b, radius)),
            &Isometry3::identity(),
        ))
    }

    /// A box with these sides, its middle at `pose`.
    ///
    /// # Errors
    /// [`SolidError::Length`] or [`SolidError::Coordinate`].
    pub fn cuboid(sides: &Point, pose: &Isometry3<f64>) -> Result<Self, SolidError> {
        sides.iter().try_for_each(|side| length("a side", *side))?;
        placement(pose)?;
        Ok(Self::new(
            Shape::Cuboid(Cuboid::new(DVec3::from(*sides) * 0.5)),
            pose,
        ))
    }

    /// What a closed surface of triangles, counter-clockwise as seen from outside, encloses. It must not cut itself.
    ///
    /// Vertices at exactly the same place are one.
    ///
    /// # Errors
    /// [`SolidError`]: a coordinate, the triangles' number, an index, an open edge, inside out.
    pub fn mesh(
        vertices: &[Point],
        triangles: &[[u32; 3]],
        pose: &Isometry3<f64>,
    ) -> Result<Self, SolidError> {
        placement(pose)?;
        vertices
            .iter()
            .try_for_each(|v| coordinates("a vertex", v))?;
        if triangles.is_empty() || triangles.len() > MAX_TRIANGLES {
            return Err(SolidError::Triangles {
                count: triangles.len(),
            });
        }
        let (vertices, triangles) = merged(vertices, triangles)?;
        check_closed(&vertices, &triangles)?;
        let volume = volume(&vertices, &triangles);
        if volume <= 0.0 {
            return Err(SolidError::InsideOut { volume });
        }
        let count = triangles.len();
        let vertices = vertices.into_iter().map(DVec3::from).collect();
        let mesh = TriMesh::with_flags(vertices, triangles, TriMeshFlags::ORIENTED);
        let mesh = mesh.map_err(|_| SolidError::Triangles { count })?;
        Ok(Self::new(Shape::Mesh(Box::new(mesh)), pose))
    }

    /// The filled cells of a grid, the lowest corner of its first cell at `pose`.
    ///
    /// # Errors
    /// [`SolidError::Voxels`] or [`SolidError::Coordinate`].
    pub fn voxels(grid: VoxelGrid, pose: &Isometry3<f64>) -> Result<Self, SolidError> {
        placement(pose)?;
        let voxels = Voxels::new(grid)?;
        Ok(Self::new(Shape::Voxels(Box::new(voxels)), pose))
    }

    fn new(shape: Shape, pose: &Isometry3<f64>) -> Self {
        let q = &pose.rotation;
        let rotation = DQuat::from_xyzw(q.i, q.j, q.k, q.w);
        let pose = Pose3::from_parts(DVec3::from(pose.translation.vector), rotation);
        let aabb = match &shape {
            Shape::Capsule(capsule) => capsule.local_aabb(),
            Shape::Cuboid(cuboid) => cuboid.local_aabb(),
            Shape::Mesh(mesh) => mesh.local_aabb(),
            Shape::Voxels(voxels) => voxels.aabb(),
        };
        Self {
            shape,
            pose,
            centre: pose.transform_point(aabb.center()).into(),
            radius: aabb.half_extents().length() * (1.0 + 1e-12),
        }
    }

    /// The nearest point of the surface to a point (base frame).
    #[must_use]
    pub fn nearest(&self, point: &Point) -> SurfacePoint {
        let local = self.pose.inverse_transform_point(DVec3::from(*point));
        let (surface, is_inside) = match &self.shape {
            Shape::Capsule(capsule) => projected(capsule, local),
            Shape::Cuboid(cuboid) => projected(cuboid, local),
            Shape::Mesh(mesh) => projected(&**mesh, local),
            Shape::Voxels(voxels) => voxels.nearest(local),
        };
        let out = if is_inside {
            surface - local
        } else {
            local - surface
        };
        let distance = out.length();
        let away = out.try_normalize().unwrap_or(DVec3::X);
        SurfacePoint {
            distance: if is_inside { -distance } else { distance },
            point: self.pose.transform_point(surface).into(),
            away: self.pose.transform_vector(away).into(),
        }
    }

    /// A lower bound of the distance from a point (base frame); negative near and inside.
    pub(crate) fn least_distance(&self, point: &Point) -> f64 {
        (point - self.centre).norm() - self.radius
    }
}

fn projected(shape: &impl PointQuery, local: DVec3) -> (DVec3, bool) {
    let projection = shape.project_local_point(local, false);
    (projection.point, projection.is_inside)
}

fn length(what: &'static str, value: f64) -> Result<(), SolidError> {
    if (MIN_EXTENT..=MAX_EXTENT).contains(&value) {
        Ok(())
    } else {
        Err(SolidError::Length { what, value })
    }
}

fn coordinates(what: &'static str, point: &Point) -> Result<(), SolidError> {
    let allowed = -MAX_EXTENT..=MAX_EXTENT;
    match point.iter().find(|v| !allowed.contains(*v)) {
        None => Ok(()),
        Some(&value) => Err(SolidError::Coordinate { what, value }),
    }
}

fn placement(pose: &Isometry3<f64>) -> Result<(), SolidError> {
    coordinates("the position", &pose.translation.vector)?;
    coordinates("the rotation", &pose.rotation.imag())
}

/// The triangles over vertices that are all different.
fn merged(
    vertices: &[Point],
    triangles: &[[u32; 3]],
) -> Result<(Vec<Point>, Vec<[u32; 3]>), SolidError> {
    let mut known = HashMap::new();
    let mut different: Vec<Point> = Vec::new();
    let new_index: Vec<u32> = vertices
        .iter()
        .map(|vertex| {
            // Adding zero makes −0 and 0 the same bits.
            *known
                .entry([0, 1, 2].map(|i| (vertex[i] + 0.0).to_bits()))
                .or_insert_with(|| {
                    different.push(*vertex);
                    different.len() as u32 - 1
                })
        })
        .collect();
    let renamed = |(triangle, corners): (usize, &[u32; 3])| {
        let missing = corners.iter().find(|&&v| v as usize >= vertices.len());
        match missing {
            None => Ok(corners.map(|v| new_index[v as usize])),
            Some(&vertex) => Err(SolidError::Vertex {
                triangle,
                vertex,
                vertices: vertices.len(),
            }),
        }
    };
    let triangles = triangles
        .iter()
        .enumerate()
        .map(renamed)
        .collect::<Result<_, _>>()?;
    Ok((different, triangles))
}

/// Refuses triangles of which an edge is open, or whose vertices are not all there; in any unit.
pub(crate) fn check_edges(vertices: &[Point], triangles: &[[u32; 3]]) -> Result<(), SolidError> {
    let (vertices, triangles) = merged(vertices, triangles)?;
    check_closed(&vertices, &triangles)
}

fn edges(triangles: &[[u32; 3]]) -> impl Iterator<Item = (u32, u32)> {
    triangles
        .iter()
        .flat_map(|[a, b, c]| [(*a, *b), (*b, *c), (*c, *a)])
}

fn check_closed(vertices: &[Point], triangles: &[[u32; 3]]) -> Result<(), SolidError> {
    let open = |(a, b): (u32, u32)| SolidError::Open {
        from: vertices[a as usize].into(),
        to: vertices[b as usize].into(),
    };
    let mut seen = HashSet::new();
    for edge in edges(triangles) {
        if edge.0 == edge.1 || !seen.insert(edge) {
            return Err(open(edge));
        }
    }
    match edges(triangles).find(|&(a, b)| !seen.contains(&(b, a))) {
        None => Ok(()),
        Some(edge) => Err(open(edge)),
    }
}

/// Signed volume, by the divergence theorem.
fn volume(vertices: &[Point], triangles: &[[u32; 3]]) -> f64 {
    let origin = vertices[0];
    let six = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| vertices[v as usize] - origin);
        a.dot(&b.cross(&c))
    };
    triangles.iter().map(six).sum::<f64>() / 6.0
}
