//! The authors' data set format, version 25: one row a path, obstacles by offsets (docs/evaluation.md "The command").

use super::archive::{ArchiveError, ArchiveReader, ArchiveWriter};
use super::columns::{expect_shape, first, integer_column, real_column, reals};
use super::paper::PaperReport;
use crate::path::WAYPOINTS;
use collision::{Ball, Scene, SceneError};
use pcc_model::{Configuration, DOF, Point};
use serde::{Deserialize, Serialize};
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Version of the format that is read and written.
const VERSION: u32 = 25;

/// The part of a data set that a row belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Split {
    /// Code 0.
    Train,
    /// Code 1.
    Validation,
    /// Code 2.
    Test,
}

impl Split {
    fn code(self) -> i8 {
        match self {
            Self::Train => 0,
            Self::Validation => 1,
            Self::Test => 2,
        }
    }
}

/// What `dataset_meta.json` says; keys that are not known are ignored.
#[derive(Clone, Debug, Serialize, Deserialize, PartialEq)]
pub struct Meta {
    /// `pcc_diffuser_npz`.
    pub format: String,
    /// 25.
    pub version: u32,
    /// Radius of every ball where no `obstacle_radii` are stored, section lengths.
    pub sphere_radius: f64,
    /// Tube radius of the body, section lengths.
    pub clearance_margin: f64,
    /// How the data was made.
    #[serde(default)]
    pub config: serde_json::Value,
    /// What the paper's generator dropped, where it was that one.
    #[serde(flatten)]
    pub report: Option<PaperReport>,
}

impl Meta {
    /// Meta data of a set made by this project with the given recipe.
    #[must_use]
    pub fn new(config: serde_json::Value) -> Self {
        Self {
            format: "pcc_diffuser_npz".into(),
            version: VERSION,
            sphere_radius: 0.4,
            clearance_margin: 0.2,
            config,
            report: None,
        }
    }
}

/// One path with its target and scene.
#[derive(Clone, Debug)]
pub struct Row {
    /// Waypoints, radians.
    pub path: Vec<Configuration>,
    /// Tip position asked for, section lengths.
    pub target_tip: Point,
    /// Index of the target in its generator.
    pub target_index: i32,
    /// Index of the start at its target.
    pub start_index: i16,
    /// Index of the end shape at its target.
    pub ik_index: i16,
    /// The part it belongs to.
    pub split: Split,
    /// Obstacles, section lengths.
    pub balls: Vec<Ball>,
    /// How its collision was judged exactly, where it was.
    pub check: Option<Check>,
}

/// An exact judgement of a path, whose maker may have looked at samples only.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Check {
    /// Smallest clearance of the tube over the waypoints, section lengths; +∞ without obstacles.
    pub clearance: f32,
    /// Whether the polyline through the waypoints is certified free.
    pub is_certified: bool,
}

/// A case: what a planner is asked (the first row of a target and start).
#[derive(Clone, Debug)]
pub struct Case {
    /// Index of the target.
    pub target_index: i32,
    /// Index of the start.
    pub start_index: i16,
    /// Start shape, radians.
    pub start: Configuration,
    /// Tip position asked for, section lengths.
    pub target_tip: Point,
    /// Obstacles.
    pub scene: Scene,
}

/// A data set in memory.
#[derive(Clone, Debug)]
pub struct Dataset {
    /// The rows, in file order.
    pub rows: Vec<Row>,
    /// Its meta data.
    pub meta: Meta,
}

/// Why a data set could not be read or written.
#[derive(Debug, Error)]
pub enum DatasetError {
    /// The archive itself.
    #[error(transparent)]
    Archive(#[from] ArchiveError),
    /// `dataset_meta.json` is missing or not understood.
    #[error("{path}: {reason}")]
    Meta {
        /// The file.
        path: PathBuf,
        /// What is wrong and what is allowed.
        reason: String,
    },
    /// An array has a shape that does not fit the others.
    #[error("array `{array}` has shape {found:?}, {expected} is needed")]
    Shape {
        /// The array.
        array: &'static str,
        /// Its shape.
        found: Vec<u64>,
        /// What fits.
        expected: String,
    },
    /// A value is out of range.
    #[error("row {row}: {reason}")]
    Row {
        /// Index of the row.
        row: usize,
        /// What is wrong and what is allowed.
        reason: String,
    },
    /// The obstacles of a row do not make a scene.
    #[error("obstacles of row {row}: {source}")]
    Scene {
        /// Index of the row.
        row: usize,
        /// The reason.
        source: SceneError,
    },
}

impl Dataset {
    /// Reads `dataset.npz` and `dataset_meta.json` from a folder; real numbers and integers of any width are taken.
    ///
    /// # Errors
    /// [`DatasetError`], naming the file or array and what is allowed.
    pub fn read(folder: &Path) -> Result<Self, DatasetError> {
        let meta = read_meta(&folder.join("dataset_meta.json"))?;
        let mut archive = ArchiveReader::open(&folder.join("dataset.npz"))?;
        let (paths, shape) = reals(&mut archive, "paths")?;
        let rows = first(&shape);
        expect_shape("paths", &shape, &[rows, WAYPOINTS, DOF])?;
        let tips = real_column(&mut archive, "target_tips", &[rows, 3])?;
        let targets = integer_column(&mut archive, "target_indices", rows)?;
        let starts = integer_column(&mut archive, "start_indices", rows)?;
        let shapes = integer_column(&mut archive, "ik_indices", rows)?;
        let splits = integer_column(&mut archive, "split_indices", rows)?;
        let obstacles = Obstacles::read(&mut archive, rows, meta.sphere_radius)?;
        let checks = read_checks(&mut archive, rows)?;
        let row = |i: usize| {
            Ok(Row {
                path: read_path(i, &paths[i * WAYPOINTS * DOF..][..WAYPOINTS * DOF])?,
                target_tip: read_tip(i, &tips[3 * i..][..3])?,
                target_index: index(i, "target", targets[i])?,
                start_index: index(i, "start", starts[i])?,
                ik_index: index(i, "end shape", shapes[i])?,
                split: split_of(i, splits[i])?,
                balls: obstacles.of(i)?,
                check: checks.as_ref().map(|checks| checks[i]),
            })
        };
        Ok(Self {
            rows: (0..rows).map(row).collect::<Result<_, DatasetError>>()?,
            meta,
        })
    }

    /// Writes both files into a folder, which is made if need be; each appears whole, the meta data last.
    ///
    /// # Errors
    /// [`DatasetError::Archive`] or [`DatasetError::Meta`].
    pub fn write(&self, folder: &Path) -> Result<(), DatasetError> {
        let path = folder.join("dataset_meta.json");
        let fail = |reason: String| DatasetError::Meta {
            path: path.clone(),
            reason,
        };
        std::fs::create_dir_all(folder).map_err(|e| fail(e.to_string()))?;
        let arrays = folder.join("dataset.npz");
        let part = part_of(&arrays);
        self.write_arrays(&part)?;
        std::fs::rename(&part, &arrays).map_err(|e| fail(e.to_string()))?;
        let text = serde_json::to_string_pretty(&self.meta).map_err(|e| fail(e.to_string()))?;
        let part = part_of(&path);
        std::fs::write(&part, text).map_err(|e| fail(e.to_string()))?;
        std::fs::rename(&part, &path).map_err(|e| fail(e.to_string()))
    }

    fn write_arrays(&self, file: &Path) -> Result<(), ArchiveError> {
        let rows = &self.rows;
        let n = rows.len();
        let balls: Vec<&Ball> = rows.iter().flat_map(|r| &r.balls).collect();
        let mut archive = ArchiveWriter::create(file)?;
        archive.write(
            "paths",
            &[n, WAYPOINTS, DOF],
            rows.iter()
                .flat_map(|r| r.path.iter().flat_map(|q| q.iter().map(|v| *v as f32))),
        )?;
        archive.write(
            "target_tips",
            &[n, 3],
            rows.iter()
                .flat_map(|r| r.target_tip.iter().map(|v| *v as f32)),
        )?;
        archive.write("target_indices", &[n], rows.iter().map(|r| r.target_index))?;
        archive.write("start_indices", &[n], rows.iter().map(|r| r.start_index))?;
        archive.write("ik_indices", &[n], rows.iter().map(|r| r.ik_index))?;
        archive.write("split_indices", &[n], rows.iter().map(|r| r.split.code()))?;
        archive.write(
            "obstacle_centres",
            &[balls.len(), 3],
            balls
                .iter()
                .flat_map(|b| b.centre.iter().map(|v| *v as f32)),
        )?;
        archive.write(
            "obstacle_radii",
            &[balls.len()],
            balls.iter().map(|b| b.radius as f32),
        )?;
        let ends = rows.iter().scan(0_i64, |end, r| {
            *end += r.balls.len() as i64;
            Some(*end)
        });
        archive.write("obstacle_offsets", &[n + 1], std::iter::once(0).chain(ends))?;
        self.write_checks(&mut archive)?;
        archive.finish()
    }

    /// Writes `clearances` and `certified`, if every row has them.
    fn write_checks(&self, archive: &mut ArchiveWriter) -> Result<(), ArchiveError> {
        let checks: Option<Vec<Check>> = self.rows.iter().map(|row| row.check).collect();
        let Some(checks) = checks else {
            return Ok(());
        };
        let shape = [checks.len()];
        archive.write("clearances", &shape, checks.iter().map(|c| c.clearance))?;
        archive.write(
            "certified",
            &shape,
            checks.iter().map(|c| u8::from(c.is_certified)),
        )
    }

    /// The distinct cases of a split in file order, at most `limit`.
    ///
    /// # Errors
    /// [`DatasetError::Scene`].
    pub fn cases(&self, split: Split, limit: Option<usize>) -> Result<Vec<Case>, DatasetError> {
        let mut seen = HashSet::new();
        let mut cases = Vec::new();
        for (index, row) in self
            .rows
            .iter()
            .enumerate()
            .filter(|(_, r)| r.split == split)
        {
            if limit.is_some_and(|l| cases.len() >= l) {
                break;
            }
            if seen.insert((row.target_index, row.start_index)) {
                cases.push(case_of(index, row)?);
            }
        }
        Ok(cases)
    }
}

fn read_checks(
    archive: &mut ArchiveReader,
    rows: usize,
) -> Result<Option<Vec<Check>>, DatasetError> {
    if !(archive.has("clearances") && archive.has("certified")) {
        return Ok(None);
    }
    let clearances = real_column(archive, "clearances", &[rows])?;
    let certified = integer_column(archive, "certified", rows)?;
    let checks = clearances.into_iter().zip(certified);
    Ok(Some(
        checks
            .map(|(clearance, certified)| Check {
                clearance,
                is_certified: certified != 0,
            })
            .collect(),
    ))
}

/// Where a file is written before it is whole; of this process alone, since shards may end at the same time.
fn part_of(file: &Path) -> PathBuf {
    file.with_extension(format!("{}.part", std::process::id()))
}

fn case_of(index: usize, row: &Row) -> Result<Case, DatasetError> {
    let scene = Scene::new(row.balls.clone())
        .map_err(|source| DatasetError::Scene { row: index, source })?;
    Ok(Case {
        target_index: row.target_index,
        start_index: row.start_index,
        start: row.path[0],
        target_tip: row.target_tip,
        scene,
    })
}

struct Obstacles {
    centres: Vec<f32>,
    radii: Vec<f32>,
    offsets: Vec<i64>,
}

impl Obstacles {
    fn read(
        archive: &mut ArchiveReader,
        rows: usize,
        default_radius: f64,
    ) -> Result<Self, DatasetError> {
        let (centres, shape) = reals(archive, "obstacle_centres")?;
        let count = first(&shape);
        expect_shape("obstacle_centres", &shape, &[count, 3])?;
        let offsets = integer_column(archive, "obstacle_offsets", rows + 1)?;
        let radii = if archive.has("obstacle_radii") {
            real_column(archive, "obstacle_radii", &[count])?
        } else {
            vec![default_radius as f32; count]
        };
        Ok(Self {
            centres,
            radii,
            offsets,
        })
    }

    fn of(&self, row: usize) -> Result<Vec<Ball>, DatasetError> {
        let (first, end) = (self.offsets[row], self.offsets[row + 1]);
        if first < 0 || end < first || end as usize > self.radii.len() {
            let reason = format!(
                "obstacle offsets {first}..{end}; they must rise and stay within 0..={}",
                self.radii.len()
            );
            return Err(DatasetError::Row { row, reason });
        }
        let ball = |i: usize| Ball {
            centre: Point::from_fn(|axis, _| f64::from(self.centres[3 * i + axis])),
            radius: f64::from(self.radii[i]),
        };
        Ok((first as usize..end as usize).map(ball).collect())
    }
}

fn read_meta(path: &Path) -> Result<Meta, DatasetError> {
    let fail = |reason: String| DatasetError::Meta {
        path: path.into(),
        reason,
    };
    let text = std::fs::read_to_string(path).map_err(|e| fail(e.to_string()))?;
    let meta: Meta = serde_json::from_str(&text).map_err(|e| fail(e.to_string()))?;
    if meta.format != "pcc_diffuser_npz" || meta.version != VERSION {
        return Err(fail(format!(
            "format `{}` version {}; `pcc_diffuser_npz` version {VERSION} is needed",
            meta.format, meta.version
        )));
    }
    Ok(meta)
}

fn read_path(row: usize, values: &[f32]) -> Result<Vec<Configuration>, DatasetError> {
    if values.iter().any(|v| !v.is_finite()) {
        return Err(DatasetError::Row {
            row,
            reason: "the path has values that are not finite".into(),
        });
    }
    Ok(values
        .chunks_exact(DOF)
        .map(|c| Configuration::from_fn(|d, _| f64::from(c[d])))
        .collect())
}

fn read_tip(row: usize, values: &[f32]) -> Result<Point, DatasetError> {
    if values.iter().any(|v| !v.is_finite()) {
        return Err(DatasetError::Row {
            row,
            reason: format!("target tip {values:?}; finite numbers are needed"),
        });
    }
    Ok(Point::from_fn(|axis, _| f64::from(values[axis])))
}

fn index<T: TryFrom<i64>>(row: usize, what: &str, value: i64) -> Result<T, DatasetError> {
    T::try_from(value).map_err(|_| DatasetError::Row {
        row,
        reason: format!("{what} index {value} is out of range"),
    })
}

fn split_of(row: usize, code: i64) -> Result<Split, DatasetError> {
    [Split::Train, Split::Validation, Split::Test]
        .into_iter()
        .find(|s| i64::from(s.code()) == code)
        .ok_or_else(|| DatasetError::Row {
            row,
            reason: format!("split code {code}; 0, 1 or 2 is needed"),
        })
}
