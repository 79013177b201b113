//! Static scenes from files: balls, capsules, boxes, meshes, voxel grids, lengths in metres in the base frame.

use crate::obstacle::ball::Ball;
use crate::obstacle::closed_mesh::check_edges;
use crate::obstacle::limits::{MAX_EXTENT, MIN_EXTENT};
use crate::obstacle::solid::Solid;
use crate::obstacle::voxel_grid::VoxelGrid;
use crate::scene::file_error::{EntryError, MAX_FILE_BALLS, SceneFileError};
use crate::scene::solid_files::{read_grid, read_mesh};
use crate::scene::static_scene::Scene;
use input_files::SettingsFile;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use pcc_model::{Numbers, Point};
use serde::Deserialize;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// How far a quaternion's norm may be from 1.
const UNIT_TOLERANCE: f64 = 1e-3;
/// Largest angle of a rotation vector, rad: two turns and some rounding.
const MAX_ROTATION_RAD: f64 = 13.0;
/// Units of length that a mesh may be in, m.
const UNITS_M: RangeInclusive<f64> = 1e-6..=1e3;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    balls: Option<Vec<BallEntry>>,
    #[serde(default)]
    capsules: Vec<CapsuleEntry>,
    #[serde(default)]
    boxes: Vec<BoxEntry>,
    #[serde(default)]
    meshes: Vec<MeshEntry>,
    #[serde(default)]
    voxels: Vec<VoxelsEntry>,
}

impl File {
    fn is_silent(&self) -> bool {
        self.balls.is_none()
            && self.capsules.is_empty()
            && self.boxes.is_empty()
            && self.meshes.is_empty()
            && self.voxels.is_empty()
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BallEntry {
    centre_m: Numbers<3>,
    radius_m: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CapsuleEntry {
    from_m: Numbers<3>,
    to_m: Numbers<3>,
    radius_m: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BoxEntry {
    sides_m: Numbers<3>,
    position_m: Numbers<3>,
    quaternion_xyzw: Option<Numbers<4>>,
    rotation_vector_rad: Option<Numbers<3>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MeshEntry {
    file: PathBuf,
    /// Length of the file's unit.
    #[serde(default = "one")]
    unit_m: f64,
    position_m: Numbers<3>,
    quaternion_xyzw: Option<Numbers<4>>,
    rotation_vector_rad: Option<Numbers<3>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct VoxelsEntry {
    file: PathBuf,
    voxel_m: f64,
    /// Lowest corner of the first voxel.
    position_m: Numbers<3>,
    quaternion_xyzw: Option<Numbers<4>>,
    rotation_vector_rad: Option<Numbers<3>>,
}

fn one() -> f64 {
    1.0
}

impl Scene {
    /// Reads a scene file (`tests/data/scenes/workshop.toml` shows every key) in units of `section_length_m`; files that it
    /// names are relative to its folder.
    ///
    /// # Errors
    /// [`SceneFileError`], naming the file, the entry and what is allowed.
    pub fn from_file(path: &Path, section_length_m: f64) -> Result<Self, SceneFileError> {
        let file: File = SettingsFile { path }.read()?;
        if file.is_silent() {
            return Err(SceneFileError::Silent { path: path.into() });
        }
        let balls = file.balls.as_deref().unwrap_or_default();
        if balls.len() > MAX_FILE_BALLS {
            return Err(SceneFileError::Balls {
                path: path.into(),
                count: balls.len(),
            });
        }
        let reader = Reader {
            path,
            unit: section_length_m,
        };
        let balls = reader.entries("balls", balls, Reader::ball)?;
        let solids = reader.solids(&file)?;
        Self::with_solids(balls, solids).map_err(|source| SceneFileError::Scene {
            path: path.into(),
            source,
        })
    }
}

/// Turns entries, in metres, into obstacles.
struct Reader<'a> {
    /// The scene file.
    path: &'a Path,
    /// Length of the scene's unit, m.
    unit: f64,
}

impl Reader<'_> {
    /// Turns each entry of a list into an obstacle; the error names the entry that is refused.
    fn entries<E, T>(
        &self,
        list: &str,
        entries: &[E],
        read: impl Fn(&Self, &E) -> Result<T, EntryError>,
    ) -> Result<Vec<T>, SceneFileError> {
        let numbered = entries.iter().enumerate();
        let read = |(i, entry)| {
            read(self, entry).map_err(|source| SceneFileError::Entry {
                path: self.path.into(),
                entry: format!("{list}[{i}]"),
                source: Box::new(source),
            })
        };
        numbered.map(read).collect()
    }

    fn solids(&self, file: &File) -> Result<Vec<Arc<Solid>>, SceneFileError> {
        let mut solids = self.entries("capsules", &file.capsules, Self::capsule)?;
        solids.extend(self.entries("boxes", &file.boxes, Self::cuboid)?);
        solids.extend(self.entries("meshes", &file.meshes, Self::mesh)?);
        solids.extend(self.entries("voxels", &file.voxels, Self::voxels)?);
        Ok(solids.into_iter().map(Arc::new).collect())
    }

    fn ball(&self, entry: &BallEntry) -> Result<Ball, EntryError> {
        Ok(Ball {
            centre: self.point("centre_m", &entry.centre_m)?,
            radius: self.length("radius_m", entry.radius_m, 0.0)?,
        })
    }

    fn capsule(&self, entry: &CapsuleEntry) -> Result<Solid, EntryError> {
        let from = self.point("from_m", &entry.from_m)?;
        let to = self.point("to_m", &entry.to_m)?;
        let radius = self.length("radius_m", entry.radius_m, MIN_EXTENT)?;
        Ok(Solid::capsule([from, to], radius)?)
    }

    fn cuboid(&self, entry: &BoxEntry) -> Result<Solid, EntryError> {
        for side in entry.sides_m.0 {
            self.length("sides_m", side, MIN_EXTENT)?;
        }
        let sides = Point::from(entry.sides_m.0) / self.unit;
        let rotation = rotation(entry.quaternion_xyzw, entry.rotation_vector_rad)?;
        Ok(Solid::cuboid(
            &sides,
            &self.pose(&entry.position_m, rotation)?,
        )?)
    }

    fn mesh(&self, entry: &MeshEntry) -> Result<Solid, EntryError> {
        let rotation = rotation(entry.quaternion_xyzw, entry.rotation_vector_rad)?;
        let pose = self.pose(&entry.position_m, rotation)?;
        if !UNITS_M.contains(&entry.unit_m) {
            return Err(EntryError::Value {
                key: "unit_m",
                value: entry.unit_m,
                allowed: format!("{:e} to {:e} m", UNITS_M.start(), UNITS_M.end()),
            });
        }
        let path = self.beside(&entry.file);
        let (mut vertices, triangles) = read_mesh(&path)?;
        let scale = entry.unit_m / self.unit;
        check_in_its_unit(&path, &vertices, &triangles, MAX_EXTENT / scale)?;
        vertices.iter_mut().for_each(|vertex| *vertex *= scale);
        Solid::mesh(&vertices, &triangles, &pose)
            .map_err(|source| EntryError::SolidOfFile { path, source })
    }

    fn voxels(&self, entry: &VoxelsEntry) -> Result<Solid, EntryError> {
        let rotation = rotation(entry.quaternion_xyzw, entry.rotation_vector_rad)?;
        let pose = self.pose(&entry.position_m, rotation)?;
        let cell = self.length("voxel_m", entry.voxel_m, MIN_EXTENT)?;
        let path = self.beside(&entry.file);
        let (counts, filled) = read_grid(&path)?;
        let grid = VoxelGrid {
            counts,
            cell,
            filled,
        };
        Solid::voxels(grid, &pose).map_err(|source| EntryError::SolidOfFile { path, source })
    }

    /// A file that the scene file names, relative to its folder.
    fn beside(&self, file: &Path) -> PathBuf {
        self.path.parent().unwrap_or(Path::new(".")).join(file)
    }

    /// A length given in metres, in units of the scene, where it is from `least` (in these units) to [`MAX_EXTENT`].
    fn length(&self, key: &'static str, metres: f64, least: f64) -> Result<f64, EntryError> {
        let length = metres / self.unit;
        if (least..=MAX_EXTENT).contains(&length) {
            return Ok(length);
        }
        Err(EntryError::Value {
            key,
            value: metres,
            allowed: format!("{:e} to {:e} m", least * self.unit, MAX_EXTENT * self.unit),
        })
    }

    /// A point given in metres, in units of the scene, where its coordinates are within ±[`MAX_EXTENT`].
    fn point(&self, key: &'static str, metres: &Numbers<3>) -> Result<Point, EntryError> {
        let point = Point::from(metres.0) / self.unit;
        let allowed = -MAX_EXTENT..=MAX_EXTENT;
        match point.iter().position(|v| !allowed.contains(v)) {
            None => Ok(point),
            Some(axis) => Err(EntryError::Value {
                key,
                value: metres.0[axis],
                allowed: format!("within ±{:e} m", MAX_EXTENT * self.unit),
            }),
        }
    }

    fn pose(
        &self,
        position_m: &Numbers<3>,
        rotation: UnitQuaternion<f64>,
    ) -> Result<Isometry3<f64>, EntryError> {
        let translation = Translation3::from(self.point("position_m", position_m)?);
        Ok(Isometry3::from_parts(translation, rotation))
    }
}

/// Refuses a coordinate and an open edge of a mesh as its file has them, before they are turned into units.
fn check_in_its_unit(
    path: &Path,
    vertices: &[Point],
    triangles: &[[u32; 3]],
    most: f64,
) -> Result<(), EntryError> {
    let mut coordinates = vertices.iter().flat_map(|vertex| vertex.iter());
    if let Some(value) = coordinates.find(|value| !(-most..=most).contains(*value)) {
        return Err(EntryError::Content {
            path: path.into(),
            reason: format!("a `vertex` has the coordinate {value:e}; within ±{most:e} is allowed"),
        });
    }
    check_edges(vertices, triangles).map_err(|source| EntryError::SolidOfFile {
        path: path.into(),
        source,
    })
}

/// The rotation of an entry that gives it in at most one of two ways.
fn rotation(
    quaternion: Option<Numbers<4>>,
    vector: Option<Numbers<3>>,
) -> Result<UnitQuaternion<f64>, EntryError> {
    match (quaternion, vector) {
        (None, None) => Ok(UnitQuaternion::identity()),
        (None, Some(Numbers(vector))) => {
            let angle = Vector3::from(vector).norm();
            if angle <= MAX_ROTATION_RAD {
                return Ok(UnitQuaternion::from_scaled_axis(Vector3::from(vector)));
            }
            Err(EntryError::Rotation(format!(
                "rotation_vector_rad is {vector:?}; an angle of at most {MAX_ROTATION_RAD} rad is allowed"
            )))
        }
        (Some(Numbers(values)), None) => {
            let [x, y, z, w] = values;
            let quaternion = Quaternion::new(w, x, y, z);
            let norm = quaternion.norm();
            let is_unit = (norm - 1.0).abs() <= UNIT_TOLERANCE;
            if !is_unit {
                return Err(EntryError::Rotation(format!(
                    "quaternion_xyzw is {values:?}, of norm {norm}; a norm of 1 to within {UNIT_TOLERANCE} is allowed"
                )));
            }
            Ok(UnitQuaternion::from_quaternion(quaternion))
        }
        (Some(_), Some(_)) => Err(EntryError::Rotation(
            "quaternion_xyzw and rotation_vector_rad are both given; at most one is allowed".into(),
        )),
    }
}
