//! Static scenes from files: balls, capsules, boxes, meshes, voxel grids, lengths in metres in the base frame.

use crate::scene::{Ball, Scene, SceneError};
use crate::solid::{Solid, SolidError};
use crate::voxels::{MAX_CELLS, VoxelGrid};
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use npyz::{DType, NpyFile, Order, TypeChar};
use pcc_model::Point;
use serde::Deserialize;
use std::fs::File as DiskFile;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use thiserror::Error;

/// Balls that a scene file may hold, so that a request's own have room beside them.
const MAX_FILE_BALLS: usize = 1024;
/// How far a quaternion's norm may be from 1.
const UNIT_TOLERANCE: f64 = 1e-3;

/// Why a scene file is refused.
#[derive(Debug, Error)]
pub enum SceneFileError {
    /// A file cannot be read.
    #[error("cannot read {path:?}: {source}")]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The system's answer.
        source: std::io::Error,
    },
    /// The file is not TOML, a key is missing or unknown, or a value has the wrong type.
    #[error("scene file {path:?} is not understood: {source}")]
    Syntax {
        /// The file.
        path: PathBuf,
        /// Where and what.
        source: Box<toml::de::Error>,
    },
    /// A file with a mesh or a grid is not understood.
    #[error("{entry}: {path:?} is not understood: {reason}")]
    Content {
        /// Which entry names it.
        entry: String,
        /// The file.
        path: PathBuf,
        /// What is wrong and what is allowed.
        reason: String,
    },
    /// A rotation is none.
    #[error("{entry}: {reason}")]
    Rotation {
        /// Which entry.
        entry: String,
        /// What is wrong and what is allowed.
        reason: String,
    },
    /// The numbers of an entry do not make a solid; lengths in section lengths of the robot.
    #[error("{entry}: {source}")]
    Solid {
        /// Which entry.
        entry: String,
        /// What is wrong.
        source: SolidError,
    },
    /// Too many balls for a file.
    #[error("scene file {path:?} has {count} balls; at most {MAX_FILE_BALLS} are allowed")]
    Balls {
        /// The file.
        path: PathBuf,
        /// How many.
        count: usize,
    },
    /// The obstacles do not make a scene; lengths in section lengths of the robot.
    #[error("scene file {path:?}: {source}")]
    Scene {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: SceneError,
    },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default)]
    balls: Vec<BallEntry>,
    #[serde(default)]
    capsules: Vec<CapsuleEntry>,
    #[serde(default)]
    boxes: Vec<BoxEntry>,
    #[serde(default)]
    meshes: Vec<MeshEntry>,
    #[serde(default)]
    voxels: Vec<VoxelsEntry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BallEntry {
    centre_m: [f64; 3],
    radius_m: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CapsuleEntry {
    from_m: [f64; 3],
    to_m: [f64; 3],
    radius_m: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BoxEntry {
    sides_m: [f64; 3],
    position_m: [f64; 3],
    quaternion_xyzw: Option<[f64; 4]>,
    rotation_vector_rad: Option<[f64; 3]>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MeshEntry {
    file: PathBuf,
    /// Length of the file's unit.
    #[serde(default = "one")]
    unit_m: f64,
    position_m: [f64; 3],
    quaternion_xyzw: Option<[f64; 4]>,
    rotation_vector_rad: Option<[f64; 3]>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct VoxelsEntry {
    file: PathBuf,
    voxel_m: f64,
    /// Lowest corner of the first voxel.
    position_m: [f64; 3],
    quaternion_xyzw: Option<[f64; 4]>,
    rotation_vector_rad: Option<[f64; 3]>,
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
        let unreadable = |source| SceneFileError::Unreadable {
            path: path.into(),
            source,
        };
        let text = std::fs::read_to_string(path).map_err(unreadable)?;
        let file: File = toml::from_str(&text).map_err(|source| SceneFileError::Syntax {
            path: path.into(),
            source: Box::new(source),
        })?;
        if file.balls.len() > MAX_FILE_BALLS {
            return Err(SceneFileError::Balls {
                path: path.into(),
                count: file.balls.len(),
            });
        }
        let reader = Reader {
            folder: path.parent().unwrap_or(Path::new(".")),
            unit: section_length_m,
        };
        let balls = file.balls.iter().map(|ball| reader.ball(ball)).collect();
        let solids = reader.solids(&file)?;
        Self::with_solids(balls, solids).map_err(|source| SceneFileError::Scene {
            path: path.into(),
            source,
        })
    }
}

/// Turns entries, in metres, into obstacles.
struct Reader<'a> {
    folder: &'a Path,
    /// Metres a unit of length.
    unit: f64,
}

impl Reader<'_> {
    fn ball(&self, entry: &BallEntry) -> Ball {
        Ball {
            centre: self.point(&entry.centre_m),
            radius: entry.radius_m / self.unit,
        }
    }

    fn solids(&self, file: &File) -> Result<Vec<Arc<Solid>>, SceneFileError> {
        let mut solids = Vec::new();
        for (i, entry) in file.capsules.iter().enumerate() {
            let ends = [self.point(&entry.from_m), self.point(&entry.to_m)];
            let capsule = Solid::capsule(ends, entry.radius_m / self.unit);
            solids.push(named(&format!("capsules[{i}]"), capsule)?);
        }
        for (i, entry) in file.boxes.iter().enumerate() {
            let name = format!("boxes[{i}]");
            let (quaternion, vector) = (entry.quaternion_xyzw, entry.rotation_vector_rad);
            let pose = self.pose(&name, &entry.position_m, quaternion, vector)?;
            solids.push(named(
                &name,
                Solid::cuboid(&self.point(&entry.sides_m), &pose),
            )?);
        }
        for (i, entry) in file.meshes.iter().enumerate() {
            solids.push(self.mesh(&format!("meshes[{i}]"), entry)?);
        }
        for (i, entry) in file.voxels.iter().enumerate() {
            solids.push(self.voxels(&format!("voxels[{i}]"), entry)?);
        }
        Ok(solids.into_iter().map(Arc::new).collect())
    }

    fn mesh(&self, name: &str, entry: &MeshEntry) -> Result<Solid, SceneFileError> {
        let (quaternion, vector) = (entry.quaternion_xyzw, entry.rotation_vector_rad);
        let pose = self.pose(name, &entry.position_m, quaternion, vector)?;
        named(name, crate::solid::length("unit_m", entry.unit_m))?;
        let path = self.folder.join(&entry.file);
        let (mut vertices, triangles) = read_mesh(name, &path)?;
        let scale = entry.unit_m / self.unit;
        vertices.iter_mut().for_each(|vertex| *vertex *= scale);
        named(name, Solid::mesh(&vertices, &triangles, &pose))
    }

    fn voxels(&self, name: &str, entry: &VoxelsEntry) -> Result<Solid, SceneFileError> {
        let (quaternion, vector) = (entry.quaternion_xyzw, entry.rotation_vector_rad);
        let pose = self.pose(name, &entry.position_m, quaternion, vector)?;
        let path = self.folder.join(&entry.file);
        let (counts, filled) = read_grid(name, &path)?;
        let grid = VoxelGrid {
            counts,
            cell: entry.voxel_m / self.unit,
            filled,
        };
        named(name, Solid::voxels(grid, &pose))
    }

    fn point(&self, metres: &[f64; 3]) -> Point {
        Point::from(*metres) / self.unit
    }

    fn pose(
        &self,
        entry: &str,
        position_m: &[f64; 3],
        quaternion: Option<[f64; 4]>,
        vector: Option<[f64; 3]>,
    ) -> Result<Isometry3<f64>, SceneFileError> {
        let refused = |reason: String| SceneFileError::Rotation {
            entry: entry.into(),
            reason,
        };
        let rotation = match (quaternion, vector) {
            (None, None) => UnitQuaternion::identity(),
            (None, Some(vector)) if vector.iter().all(|v| v.is_finite()) => {
                UnitQuaternion::from_scaled_axis(Vector3::from(vector))
            }
            (None, Some(vector)) => {
                return Err(refused(format!(
                    "rotation_vector_rad is {vector:?}; finite numbers are allowed"
                )));
            }
            (Some([x, y, z, w]), None) => {
                let quaternion = Quaternion::new(w, x, y, z);
                let norm = quaternion.norm();
                let is_unit = (norm - 1.0).abs() <= UNIT_TOLERANCE;
                if !is_unit {
                    return Err(refused(format!(
                        "quaternion_xyzw has norm {norm}; 1 to within {UNIT_TOLERANCE} is allowed"
                    )));
                }
                UnitQuaternion::from_quaternion(quaternion)
            }
            (Some(_), Some(_)) => {
                return Err(refused(
                    "quaternion_xyzw and rotation_vector_rad are both given; at most one is allowed".into(),
                ));
            }
        };
        let translation = Translation3::from(self.point(position_m));
        Ok(Isometry3::from_parts(translation, rotation))
    }
}

fn named<T>(entry: &str, solid: Result<T, SolidError>) -> Result<T, SceneFileError> {
    solid.map_err(|source| SceneFileError::Solid {
        entry: entry.into(),
        source,
    })
}

type Mesh = (Vec<Point>, Vec<[u32; 3]>);

/// Reads an STL or OBJ file, in its own unit.
fn read_mesh(entry: &str, path: &Path) -> Result<Mesh, SceneFileError> {
    let extension = path
        .extension()
        .and_then(|e| e.to_str())
        .unwrap_or_default();
    let content = |reason: String| not_understood(entry, path, reason);
    let mut file = BufReader::new(open(path)?);
    match extension.to_ascii_lowercase().as_str() {
        "stl" => {
            let mesh = stl_io::read_stl(&mut file).map_err(|e| content(e.to_string()))?;
            let vertex = |v: &stl_io::Vertex| Point::from(v.0.map(f64::from));
            let triangle = |t: &stl_io::IndexedTriangle| t.vertices.map(|v| v as u32);
            Ok((
                mesh.vertices.iter().map(vertex).collect(),
                mesh.faces.iter().map(triangle).collect(),
            ))
        }
        "obj" => {
            let options = tobj::LoadOptions {
                triangulate: true,
                ..tobj::LoadOptions::default()
            };
            let no_materials = |_: &Path| Err(tobj::LoadError::OpenFileFailed);
            let (models, _) = tobj::load_obj_buf(&mut file, &options, no_materials)
                .map_err(|e| content(e.to_string()))?;
            Ok(joined(&models))
        }
        _ => Err(content(
            "the names of mesh files end in .stl or .obj".into(),
        )),
    }
}

/// The parts of an OBJ file as one mesh.
fn joined(models: &[tobj::Model]) -> Mesh {
    let (mut vertices, mut triangles): Mesh = (Vec::new(), Vec::new());
    for model in models {
        let first = vertices.len() as u32;
        let positions = model.mesh.positions.chunks_exact(3);
        vertices.extend(positions.map(Point::from_column_slice));
        let corners = model.mesh.indices.chunks_exact(3);
        triangles.extend(corners.map(|t| [t[0] + first, t[1] + first, t[2] + first]));
    }
    (vertices, triangles)
}

/// Reads a grid of bytes or booleans: not zero is filled.
fn read_grid(entry: &str, path: &Path) -> Result<([usize; 3], Vec<bool>), SceneFileError> {
    let content = |reason: String| not_understood(entry, path, reason);
    let npy = NpyFile::new(BufReader::new(open(path)?)).map_err(|e| content(e.to_string()))?;
    let is_bytes = |dtype: &DType| match dtype {
        DType::Plain(t) => {
            matches!(t.type_char(), TypeChar::Uint | TypeChar::Bool) && t.size_field() == 1
        }
        _ => false,
    };
    let (dtype, order, shape) = (npy.dtype(), npy.order(), npy.shape().to_vec());
    let &[x, y, z] = shape.as_slice() else {
        return Err(content(format!(
            "it has shape {shape:?}; three dimensions are needed"
        )));
    };
    if !is_bytes(&dtype) || order != Order::C {
        return Err(content(format!(
            "it holds {} in {order:?} order; u1 or b1 in C order is needed",
            dtype.descr()
        )));
    }
    let cells = shape
        .iter()
        .try_fold(1_u64, |cells, n| cells.checked_mul(*n));
    if cells.is_none_or(|cells| cells > MAX_CELLS as u64) {
        return Err(content(format!(
            "it has shape {shape:?}; at most {MAX_CELLS} voxels are allowed"
        )));
    }
    let is_bool = matches!(&dtype, DType::Plain(t) if t.type_char() == TypeChar::Bool);
    let filled: Result<Vec<bool>, _> = if is_bool {
        npy.into_vec::<bool>()
    } else {
        npy.into_vec::<u8>()
            .map(|bytes| bytes.iter().map(|b| *b != 0).collect())
    };
    let filled = filled.map_err(|e| content(e.to_string()))?;
    Ok(([x, y, z].map(|n| n as usize), filled))
}

fn open(path: &Path) -> Result<DiskFile, SceneFileError> {
    DiskFile::open(path).map_err(|source| SceneFileError::Unreadable {
        path: path.into(),
        source,
    })
}

fn not_understood(entry: &str, path: &Path, reason: String) -> SceneFileError {
    SceneFileError::Content {
        entry: entry.into(),
        path: path.into(),
        reason,
    }
}
