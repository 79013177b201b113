//! The authors' data set format, version 25: one row a path, obstacles by offsets (docs/evaluation.md "The command").

use super::columns::{integers, reals, rows_of};
use super::meta::{Counts, Meta};
use crate::path::WAYPOINTS;
use arrays::{ArchiveError, ArchiveReader, ArchiveWriter};
use collision::{Ball, MAX_EXTENT, Scene, SceneError};
use pcc_model::{Configuration, DOF, Point};
use sha2::{Digest, Sha256};
use std::collections::HashSet;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use thiserror::Error;

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
    pub(super) fn code(self) -> i8 {
        match self {
            Self::Train => 0,
            Self::Validation => 1,
            Self::Test => 2,
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
    /// No path was kept, so there is no set.
    #[error("there is no path to make a data set of{}", .counts.as_ref().map(|c| format!(": {c}")).unwrap_or_default())]
    Empty {
        /// What was dropped and why, where it is known.
        counts: Option<Box<Counts>>,
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
        let meta = Meta::read(folder)?;
        let file = folder.join(ARRAYS);
        let wrong_meta = |reason: String| DatasetError::Meta {
            path: folder.join("dataset_meta.json"),
            reason,
        };
        if let Some(expected) = &meta.arrays_sha256 {
            let found = sha256(&file)?;
            if found != *expected {
                return Err(wrong_meta(format!(
                    "arrays_sha256 is {expected}, that of dataset.npz is {found}: it is damaged, or of another set"
                )));
            }
        }
        let mut archive = ArchiveReader::open(&file)?;
        let shapes = Shapes::check(&archive)?;
        if shapes.rows == 0 {
            let counts = meta.counts.map(Box::new);
            return Err(DatasetError::Empty { counts });
        }
        archive.check_all()?;
        let rows = read_rows(&mut archive, &shapes, meta.sphere_radius)?;
        meta.check_rows(&rows).map_err(wrong_meta)?;
        Ok(Self { rows, meta })
    }

    /// Writes both files into a folder, which is made if need be; each appears whole, the meta data last.
    ///
    /// # Errors
    /// [`DatasetError::Empty`] where there is no row: nothing is written then; [`DatasetError::Archive`] or
    /// [`DatasetError::Meta`].
    pub fn write(&self, folder: &Path) -> Result<(), DatasetError> {
        if self.rows.is_empty() {
            let counts = self.meta.counts.clone().map(Box::new);
            return Err(DatasetError::Empty { counts });
        }
        let file = folder.join(ARRAYS);
        std::fs::create_dir_all(folder).map_err(|source| ArchiveError::Write {
            path: file.clone(),
            source,
        })?;
        self.write_arrays(&file)?;
        let archive = ArchiveReader::open(&file)?;
        let shapes = archive
            .shapes()
            .map(|(name, shape)| (name.to_owned(), shape.to_vec()));
        let meta = Meta {
            arrays: Some(shapes.collect()),
            arrays_sha256: Some(sha256(&file)?),
            ..self.meta.counting(&self.rows)
        };
        meta.write(folder)
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

/// Name of the file with the arrays.
const ARRAYS: &str = "dataset.npz";

/// The sizes of a set's arrays, which fit each other.
struct Shapes {
    rows: usize,
    balls: usize,
    has_radii: bool,
    has_checks: bool,
}

impl Shapes {
    /// Compares the shapes of all arrays; no value is read.
    fn check(archive: &ArchiveReader) -> Result<Self, ArchiveError> {
        let (rows, balls) = (
            rows_of(archive, "paths")?,
            rows_of(archive, "obstacle_centres")?,
        );
        archive.expect_shape("paths", &[rows, WAYPOINTS, DOF])?;
        archive.expect_shape("target_tips", &[rows, 3])?;
        for array in INDICES {
            archive.expect_shape(array, &[rows])?;
        }
        archive.expect_shape("obstacle_centres", &[balls, 3])?;
        archive.expect_shape("obstacle_offsets", &[rows.saturating_add(1)])?;
        let has_radii = archive.has("obstacle_radii");
        if has_radii {
            archive.expect_shape("obstacle_radii", &[balls])?;
        }
        let has_checks = archive.has("clearances") || archive.has("certified");
        if has_checks {
            archive.expect_shape("clearances", &[rows])?;
            archive.expect_shape("certified", &[rows])?;
        }
        Ok(Self {
            rows,
            balls,
            has_radii,
            has_checks,
        })
    }
}

/// Arrays of one whole number a row.
const INDICES: [&str; 4] = [
    "target_indices",
    "start_indices",
    "ik_indices",
    "split_indices",
];

fn read_rows(
    archive: &mut ArchiveReader,
    shapes: &Shapes,
    sphere_radius: f64,
) -> Result<Vec<Row>, DatasetError> {
    let paths = reals(archive, "paths")?;
    let tips = reals(archive, "target_tips")?;
    let [targets, starts, ends, splits] = INDICES.map(|array| integers(archive, array));
    let (targets, starts, ends, splits) = (targets?, starts?, ends?, splits?);
    let obstacles = Obstacles::read(archive, shapes, sphere_radius)?;
    let checks = match shapes.has_checks {
        true => Some(read_checks(archive)?),
        false => None,
    };
    let row = |i: usize| {
        Ok(Row {
            path: read_path(i, &paths[i * WAYPOINTS * DOF..][..WAYPOINTS * DOF])?,
            target_tip: read_tip(i, &tips[3 * i..][..3])?,
            target_index: index(i, "target", targets[i])?,
            start_index: index(i, "start", starts[i])?,
            ik_index: index(i, "end shape", ends[i])?,
            split: split_of(i, splits[i])?,
            balls: obstacles.of(i)?,
            check: checks.as_ref().map(|checks| checks[i]),
        })
    };
    (0..shapes.rows).map(row).collect()
}

fn read_checks(archive: &mut ArchiveReader) -> Result<Vec<Check>, DatasetError> {
    let clearances = reals(archive, "clearances")?;
    let certified = integers(archive, "certified")?;
    let checks = clearances.into_iter().zip(certified).enumerate();
    let check = |(row, (clearance, certified)): (usize, (f32, i64))| {
        if clearance.is_nan() || !(0..=1).contains(&certified) {
            return Err(DatasetError::Row {
                row,
                reason: format!(
                    "clearance {clearance}, certified {certified}; a number, and 0 or 1 are needed"
                ),
            });
        }
        Ok(Check {
            clearance,
            is_certified: certified == 1,
        })
    };
    checks.map(check).collect()
}

/// SHA-256 of a file, hexadecimal.
fn sha256(path: &Path) -> Result<String, ArchiveError> {
    let hash = || {
        let (mut file, mut hash) = (File::open(path)?, Sha256::new());
        let mut bytes = vec![0; 1 << 16];
        loop {
            match file.read(&mut bytes)? {
                0 => return Ok(hash.finalize()),
                count => hash.update(&bytes[..count]),
            }
        }
    };
    let hash = hash().map_err(|source| ArchiveError::File {
        path: path.into(),
        source,
    })?;
    Ok(hash.iter().map(|b| format!("{b:02x}")).collect())
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
        shapes: &Shapes,
        default_radius: f64,
    ) -> Result<Self, DatasetError> {
        let obstacles = Self {
            centres: reals(archive, "obstacle_centres")?,
            radii: match shapes.has_radii {
                true => reals(archive, "obstacle_radii")?,
                false => vec![default_radius as f32; shapes.balls],
            },
            offsets: integers(archive, "obstacle_offsets")?,
        };
        let ends = [obstacles.offsets[0], obstacles.offsets[shapes.rows]];
        if ends != [0, shapes.balls as i64] {
            return Err(DatasetError::Row {
                row: 0,
                reason: format!(
                    "obstacle_offsets are from {} to {}; from 0 to {}, the number of obstacles, is needed",
                    ends[0], ends[1], shapes.balls
                ),
            });
        }
        Ok(obstacles)
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
        let balls: Vec<Ball> = (first as usize..end as usize).map(ball).collect();
        let extent = -MAX_EXTENT..=MAX_EXTENT;
        let is_allowed = |ball: &Ball| {
            ball.centre.iter().all(|v| extent.contains(v))
                && (0.0..=MAX_EXTENT).contains(&ball.radius)
        };
        match balls.iter().find(|ball| !is_allowed(ball)) {
            None => Ok(balls),
            Some(Ball { centre, radius }) => Err(DatasetError::Row {
                row,
                reason: format!(
                    "an obstacle has centre {:?} and radius {radius}; coordinates within ±{MAX_EXTENT:e} and a radius of 0 to {MAX_EXTENT:e} are allowed",
                    <[f64; 3]>::from(*centre)
                ),
            }),
        }
    }
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
    let index = Some(value).filter(|value| *value >= 0);
    let index = index.and_then(|value| T::try_from(value).ok());
    index.ok_or_else(|| DatasetError::Row {
        row,
        reason: format!(
            "{what} index {value} is out of range; 0 to {} is allowed",
            (1_u64 << (8 * size_of::<T>() - 1)) - 1
        ),
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
