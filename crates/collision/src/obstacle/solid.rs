//! Solid obstacles through parry: capsules, boxes, closed meshes, voxel grids.

use crate::obstacle::closed_mesh::{check_closed, merged, volume};
use crate::obstacle::limits::{MAX_EXTENT, MAX_TRIANGLES, MIN_EXTENT};
use crate::obstacle::solid_error::SolidError;
use crate::obstacle::voxel_grid::{VoxelGrid, Voxels};
use glam::{DQuat, DVec3};
use nalgebra::Isometry3;
use parry3d_f64::math::Pose3;
use parry3d_f64::query::PointQuery;
use parry3d_f64::shape::{Capsule, Cuboid, TriMesh, TriMeshFlags};
use pcc_model::Point;

#[derive(Clone, Debug)]
enum Shape {
    Capsule(Capsule),
    Cuboid(Cuboid),
    Mesh(Box<TriMesh>),
    Voxels(Box<Voxels>),
}

/// Triangles around a capsule's axis, and from one of its ends to the other: for pictures.
const CAPSULE_PARTS: [u32; 2] = [32, 16];

/// A solid obstacle at rest; its inside counts.
#[derive(Clone, Debug)]
pub struct Solid {
    shape: Shape,
    pose: Pose3,
    /// Centre of a ball around the solid, base frame.
    centre: Point,
    radius: f64,
}

/// The nearest point of a solid's surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Distance to the surface; negative inside.
    pub distance: f64,
    /// The nearest point of the surface, base frame.
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

    /// What a closed surface of triangles encloses. The surface must not cut itself. Seen from outside the solid, the vertices of each
    /// triangle are in counter-clockwise order.
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

    /// The surface as triangles, for pictures: the vertices (base frame), and for each triangle the indices of its three vertices.
    /// The normal of a triangle by the right-hand rule points out of the solid. The triangles of a capsule lie inside its round surface, by 1 % of its radius at most.
    #[must_use]
    pub fn surface(&self) -> (Vec<Point>, Vec<[u32; 3]>) {
        let (vertices, triangles) = match &self.shape {
            Shape::Capsule(capsule) => capsule.to_trimesh(CAPSULE_PARTS[0], CAPSULE_PARTS[1]),
            Shape::Cuboid(cuboid) => cuboid.to_trimesh(),
            Shape::Mesh(mesh) => (mesh.vertices().to_vec(), mesh.indices().to_vec()),
            Shape::Voxels(voxels) => voxels.surface(),
        };
        let place = |vertex| self.pose.transform_point(vertex).into();
        (vertices.into_iter().map(place).collect(), triangles)
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
