//! Why a data set is not read or written.

use super::counts::Counts;
use crate::archive::error::ArchiveError;
use collision::SceneError;
use input_files::InputFileError;
use std::path::PathBuf;
use thiserror::Error;

/// Why a data set could not be read or written.
#[derive(Debug, Error)]
pub enum DatasetError {
    /// The archive is not read or written.
    #[error(transparent)]
    Archive(#[from] ArchiveError),
    /// A file is not read.
    #[error(transparent)]
    File(#[from] InputFileError),
    /// `dataset_meta.json` is not understood, or does not fit the archive.
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
    #[error("{path}: row {row}: {reason}")]
    Row {
        /// The archive.
        path: PathBuf,
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
        /// Why the obstacles make no scene.
        source: SceneError,
    },
}
