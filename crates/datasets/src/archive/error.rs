//! Why an archive is not read or written.

use input_files::InputFileError;
use std::path::PathBuf;
use thiserror::Error;

/// Why an archive could not be read or written.
#[derive(Debug, Error)]
pub enum ArchiveError {
    /// The file is not read.
    #[error(transparent)]
    File(#[from] InputFileError),
    /// Not a zip archive, or a damaged one.
    #[error(
        "{path} is not a readable NumPy archive: {reason}; an undamaged zip file of members NAME.npy, and of nothing else, is needed"
    )]
    Zip {
        /// The archive.
        path: PathBuf,
        /// What is wrong with the archive.
        reason: String,
    },
    /// The archive could not be written.
    #[error("cannot write {path}: {source}")]
    Write {
        /// The archive.
        path: PathBuf,
        /// Why the archive could not be written.
        source: std::io::Error,
    },
    /// An array is missing, damaged, or of another type or shape.
    #[error("array `{array}` of {path}: {reason}")]
    Array {
        /// The archive.
        path: PathBuf,
        /// The array's name.
        array: String,
        /// What is wrong and what is allowed.
        reason: String,
    },
}
