//! A data set in memory, its two files, and the cases of its rows.

use super::error::DatasetError;
use super::meta::{BySplit, META_FILE, Meta};
use super::rows::{Shapes, read_rows};
use crate::archive::error::ArchiveError;
use crate::archive::reader::{ArchiveReader, MAX_ARCHIVE_BYTES};
use crate::archive::writer::ArchiveWriter;
use crate::row::{Check, Row, Split};
use collision::Scene;
use input_files::{InputFile, InputFileError};
use pcc_model::{Configuration, DOF, Point};
use planning::WAYPOINTS;
use sha2::digest::Output;
use sha2::{Digest, Sha256};
use std::collections::HashSet;
use std::io::Read;
use std::path::Path;

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
    /// The set's meta data.
    pub meta: Meta,
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
            path: folder.join(META_FILE),
            reason,
        };
        if let Some(expected) = &meta.arrays_sha256 {
            let found = sha256(&file)?;
            if found != *expected {
                return Err(wrong_meta(format!(
                    "arrays_sha256 is {expected:?}; {found:?}, that of dataset.npz, is needed: one of the two is damaged, or of another set"
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
            split_counts: Some(BySplit::count(&self.rows)),
            ..self.meta.clone()
        };
        meta.write(folder)
    }

    fn write_arrays(&self, file: &Path) -> Result<(), ArchiveError> {
        let rows = &self.rows;
        let n = rows.len();
        let mut archive = ArchiveWriter::create(file)?;
        let configurations = rows.iter().flat_map(|r| &r.path);
        let paths = configurations.flat_map(|q| <[f64; DOF]>::from(*q));
        archive.write("paths", &[n, WAYPOINTS, DOF], paths.map(|v| v as f32))?;
        let tips = rows.iter().flat_map(|r| <[f64; 3]>::from(r.target_tip));
        archive.write("target_tips", &[n, 3], tips.map(|v| v as f32))?;
        archive.write("target_indices", &[n], rows.iter().map(|r| r.target_index))?;
        archive.write("start_indices", &[n], rows.iter().map(|r| r.start_index))?;
        archive.write("ik_indices", &[n], rows.iter().map(|r| r.ik_index))?;
        archive.write("split_indices", &[n], rows.iter().map(|r| r.split.code()))?;
        archive.write_balls(rows.iter().map(|r| r.balls.as_slice()), |v| v as f32)?;
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
        let certified = checks.iter().map(|c| u8::from(c.is_certified));
        archive.write("certified", &shape, certified)
    }

    /// The distinct cases of a split in file order, at most `limit`.
    ///
    /// # Errors
    /// [`DatasetError::Scene`].
    pub fn cases(&self, split: Split, limit: Option<usize>) -> Result<Vec<Case>, DatasetError> {
        let mut seen = HashSet::new();
        let mut cases = Vec::new();
        let rows = self.rows.iter().enumerate();
        for (index, row) in rows.filter(|(_, row)| row.split == split) {
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

/// SHA-256 of a file, hexadecimal.
fn sha256(path: &Path) -> Result<String, ArchiveError> {
    let mut file = InputFile::open(path, MAX_ARCHIVE_BYTES)?.into_file();
    let mut hash = || {
        let mut hash = Sha256::new();
        let mut bytes = vec![0; 1 << 16];
        loop {
            match file.read(&mut bytes)? {
                0 => return Ok(hash.finalize()),
                count => hash.update(&bytes[..count]),
            }
        }
    };
    let hash: Output<Sha256> = hash().map_err(|source| InputFileError::Unreadable {
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
