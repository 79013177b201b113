//! `dataset_meta.json`: what a set is, how it was made, and what became of what was asked for.

use super::counts::Counts;
use super::error::DatasetError;
use super::generator_notes::GeneratorNotes;
use crate::row::{Row, Split};
use collision::MAX_EXTENT;
use input_files::{read_text, shortened};
use pcc_model::SECTIONS;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::path::Path;

/// Name of the file that says what a set is.
pub(super) const META_FILE: &str = "dataset_meta.json";
/// Version of the format that is read and written.
const VERSION: u32 = 25;
/// Longest [`META_FILE`] that is read, bytes.
const MAX_BYTES: u64 = 1 << 24;
/// Radii of balls and of the body, section lengths.
const RADII: RangeInclusive<f64> = 0.0..=MAX_EXTENT;

/// What `dataset_meta.json` says, under the authors' keys; keys that are not known are ignored.
#[derive(Clone, Debug, Serialize, Deserialize, PartialEq)]
pub struct Meta {
    /// Name of the format: `pcc_diffuser_npz`.
    pub format: String,
    /// Version of the format: 25.
    pub version: u32,
    /// Whether all of the set is there; a set that says otherwise is refused.
    #[serde(default = "complete")]
    pub complete: bool,
    /// Units of the numbers.
    #[serde(default)]
    pub units: Units,
    /// Lengths of the robot's sections, in their own unit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub section_lengths: Option<[f64; SECTIONS]>,
    /// Radius of every ball where no `obstacle_radii` are stored, section lengths.
    pub sphere_radius: f64,
    /// Tube radius of the body, section lengths.
    pub clearance_margin: f64,
    /// What became of the targets and paths asked for.
    #[serde(flatten)]
    pub counts: Option<Counts>,
    /// How the generator works inside; not read.
    #[serde(flatten, skip_deserializing)]
    pub generator: GeneratorNotes,
    /// The code of each split in `split_indices`.
    #[serde(default)]
    pub split_codes: BySplit,
    /// Rows of each split.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub split_counts: Option<BySplit>,
    /// How the data was made.
    #[serde(default)]
    pub config: serde_json::Value,
    /// Name and shape of each array in `dataset.npz`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub arrays: Option<BTreeMap<String, Vec<u64>>>,
    /// SHA-256 of `dataset.npz`, hexadecimal; the authors' sets have none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub arrays_sha256: Option<String>,
}

fn complete() -> bool {
    true
}

/// Units of a data set.
#[derive(Clone, Debug, Serialize, Deserialize, PartialEq, Eq)]
pub struct Units {
    /// Unit of lengths: `normalised`, in section lengths.
    pub length: String,
    /// Unit of configurations: `radian`.
    pub configuration: String,
}

impl Default for Units {
    fn default() -> Self {
        Self {
            length: "normalised".into(),
            configuration: "radian".into(),
        }
    }
}

/// A number for each split; by default their codes.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, PartialEq, Eq)]
pub struct BySplit {
    /// The training split's.
    pub train: usize,
    /// The validation split's, by which trained models are chosen.
    pub validation: usize,
    /// The test split's, which has the last word.
    pub test: usize,
}

impl Default for BySplit {
    fn default() -> Self {
        let code = |split: Split| split.code() as usize;
        Self {
            train: code(Split::Train),
            validation: code(Split::Validation),
            test: code(Split::Test),
        }
    }
}

impl BySplit {
    /// Rows of each split.
    pub(super) fn count(rows: &[Row]) -> Self {
        let count = |split| rows.iter().filter(|row| row.split == split).count();
        Self {
            train: count(Split::Train),
            validation: count(Split::Validation),
            test: count(Split::Test),
        }
    }
}

/// What is wrong with JSON: the place, what stands there, and what is needed.
fn wrong_json(text: &str, error: &serde_json::Error) -> String {
    let line = text.lines().nth(error.line().saturating_sub(1));
    let line: Vec<char> = line.unwrap_or_default().chars().collect();
    let end = error.column().min(line.len());
    let there: String = line[..end].iter().collect();
    let there = shortened(there.trim_start());
    let reason = shortened(&error.to_string());
    format!(
        "{reason}, behind `{there}`; JSON with the keys of the format, each of its type, is needed"
    )
}

impl Meta {
    /// Meta data of a set made by this project with the given recipe.
    #[must_use]
    pub fn new(config: serde_json::Value) -> Self {
        Self {
            format: "pcc_diffuser_npz".into(),
            version: VERSION,
            complete: true,
            units: Units::default(),
            section_lengths: Some([1.0; SECTIONS]),
            sphere_radius: 0.4,
            clearance_margin: 0.2,
            counts: None,
            generator: GeneratorNotes::default(),
            split_codes: BySplit::default(),
            split_counts: None,
            config,
            arrays: None,
            arrays_sha256: None,
        }
    }

    /// Reads and checks the file of a folder.
    ///
    /// # Errors
    /// [`DatasetError::File`] or [`DatasetError::Meta`], naming the file, the key and what is allowed.
    pub fn read(folder: &Path) -> Result<Self, DatasetError> {
        let path = folder.join(META_FILE);
        let fail = |reason: String| DatasetError::Meta {
            path: path.clone(),
            reason,
        };
        let text = read_text(&path, MAX_BYTES)?;
        let meta: Self = serde_json::from_str(&text).map_err(|e| fail(wrong_json(&text, &e)))?;
        meta.check().map_err(fail)?;
        Ok(meta)
    }

    fn check(&self) -> Result<(), String> {
        if self.format != "pcc_diffuser_npz" || self.version != VERSION {
            return Err(format!(
                "`format` is {}, `version` is {}; `pcc_diffuser_npz` and {VERSION} are needed",
                shortened(&format!("{:?}", self.format)),
                self.version
            ));
        }
        if !self.complete {
            return Err("complete is false; only a whole set is read".into());
        }
        if self.units != Units::default() {
            let Units {
                length,
                configuration,
            } = &self.units;
            return Err(format!(
                "units are {}; `normalised` and `radian` are needed",
                shortened(&format!("{length:?} and {configuration:?}"))
            ));
        }
        if self.split_codes != BySplit::default() {
            return Err(format!(
                "split_codes are {:?}; {:?} is needed",
                self.split_codes,
                BySplit::default()
            ));
        }
        for (key, radius) in [
            ("sphere_radius", self.sphere_radius),
            ("clearance_margin", self.clearance_margin),
        ] {
            if !RADII.contains(&radius) {
                return Err(format!(
                    "{key} is {radius:?}; 0 to {MAX_EXTENT:e} is allowed"
                ));
            }
        }
        Ok(())
    }

    /// Checks what the meta data say of the rows.
    pub(super) fn check_rows(&self, rows: &[Row]) -> Result<(), String> {
        let found = BySplit::count(rows);
        if self.split_counts.is_some_and(|counts| counts != found) {
            return Err(format!(
                "split_counts are {:?}; {found:?}, as dataset.npz has them, are needed",
                self.split_counts.unwrap_or_default()
            ));
        }
        match &self.counts {
            Some(counts) if counts.actual_paths != rows.len() => Err(format!(
                "actual_paths is {}; {}, as dataset.npz has them, is needed",
                counts.actual_paths,
                rows.len()
            )),
            _ => Ok(()),
        }
    }

    /// Writes the file into a folder, which is made if need be; it appears whole.
    ///
    /// # Errors
    /// [`DatasetError::Meta`].
    pub fn write(&self, folder: &Path) -> Result<(), DatasetError> {
        let path = folder.join(META_FILE);
        let write = || {
            std::fs::create_dir_all(folder)?;
            let text = serde_json::to_string_pretty(self)?;
            let part = path.with_extension(format!("{}.part", std::process::id()));
            std::fs::write(&part, text)?;
            std::fs::rename(&part, &path)
        };
        write().map_err(|error| DatasetError::Meta {
            path: path.clone(),
            reason: format!("cannot write: {error}"),
        })
    }

    /// Whether a folder has such a file.
    #[must_use]
    pub fn is_in(folder: &Path) -> bool {
        folder.join(META_FILE).exists()
    }
}
