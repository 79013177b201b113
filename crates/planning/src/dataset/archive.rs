//! NumPy archives: named arrays in a compressed zip file.

use npyz::{AutoSerialize, Deserialize, NpyFile, WriterBuilder};
use std::fs::File;
use std::io::{BufReader, BufWriter};
use std::path::{Path, PathBuf};
use thiserror::Error;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

/// Why an archive could not be read or written.
#[derive(Debug, Error)]
pub enum ArchiveError {
    /// The file system refused.
    #[error("{path}: {source}")]
    File {
        /// The archive.
        path: PathBuf,
        /// The reason.
        source: std::io::Error,
    },
    /// Not a zip archive, or a damaged one.
    #[error("{path} is not a readable NumPy archive: {source}")]
    Zip {
        /// The archive.
        path: PathBuf,
        /// The reason.
        source: zip::result::ZipError,
    },
    /// An array is missing, or has another type.
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

/// Reads named arrays.
pub struct ArchiveReader {
    path: PathBuf,
    zip: ZipArchive<BufReader<File>>,
}

impl ArchiveReader {
    /// Opens an archive.
    ///
    /// # Errors
    /// [`ArchiveError::File`] or [`ArchiveError::Zip`].
    pub fn open(path: &Path) -> Result<Self, ArchiveError> {
        let file = File::open(path).map_err(|source| ArchiveError::File {
            path: path.into(),
            source,
        })?;
        let zip = ZipArchive::new(BufReader::new(file)).map_err(|source| ArchiveError::Zip {
            path: path.into(),
            source,
        })?;
        Ok(Self {
            path: path.into(),
            zip,
        })
    }

    /// Whether the archive holds an array of that name.
    #[must_use]
    pub fn has(&self, array: &str) -> bool {
        self.zip.index_for_name(&format!("{array}.npy")).is_some()
    }

    /// Reads one array in row-major order, with its shape.
    ///
    /// # Errors
    /// [`ArchiveError::Array`] if it is missing, column-major, or not of type `T`.
    pub fn read<T: Deserialize>(
        &mut self,
        array: &str,
    ) -> Result<(Vec<T>, Vec<u64>), ArchiveError> {
        let fail = |reason: String| ArchiveError::Array {
            path: self.path.clone(),
            array: array.into(),
            reason,
        };
        let entry = self
            .zip
            .by_name(&format!("{array}.npy"))
            .map_err(|e| fail(e.to_string()))?;
        let npy = NpyFile::new(entry).map_err(|e| fail(e.to_string()))?;
        if npy.order() != npyz::Order::C {
            return Err(fail("column-major order; row-major is needed".into()));
        }
        let shape = npy.shape().to_vec();
        let values = npy.into_vec().map_err(|e| fail(e.to_string()))?;
        Ok((values, shape))
    }
}

/// Writes named arrays.
pub struct ArchiveWriter {
    path: PathBuf,
    zip: ZipWriter<BufWriter<File>>,
}

impl ArchiveWriter {
    /// Starts an archive, replacing a file of that name.
    ///
    /// # Errors
    /// [`ArchiveError::File`].
    pub fn create(path: &Path) -> Result<Self, ArchiveError> {
        let file = File::create(path).map_err(|source| ArchiveError::File {
            path: path.into(),
            source,
        })?;
        Ok(Self {
            path: path.into(),
            zip: ZipWriter::new(BufWriter::new(file)),
        })
    }

    /// Adds one array given in row-major order.
    ///
    /// # Errors
    /// [`ArchiveError::Array`] if the values do not fill the shape or cannot be written.
    pub fn write<T: AutoSerialize>(
        &mut self,
        array: &str,
        shape: &[usize],
        values: impl IntoIterator<Item = T>,
    ) -> Result<(), ArchiveError> {
        let fail = |e: std::io::Error| ArchiveError::Array {
            path: self.path.clone(),
            array: array.into(),
            reason: e.to_string(),
        };
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Deflated)
            .compression_level(Some(1))
            .large_file(true);
        self.zip
            .start_file(format!("{array}.npy"), options)
            .map_err(|e| fail(e.into()))?;
        let shape: Vec<u64> = shape.iter().map(|n| *n as u64).collect();
        let mut writer = npyz::WriteOptions::new()
            .default_dtype()
            .shape(&shape)
            .writer(&mut self.zip)
            .begin_nd()
            .map_err(fail)?;
        writer.extend(values).map_err(fail)?;
        writer.finish().map_err(fail)
    }

    /// Ends the archive.
    ///
    /// # Errors
    /// [`ArchiveError::Zip`].
    pub fn finish(self) -> Result<(), ArchiveError> {
        let path = self.path;
        self.zip
            .finish()
            .map(|_| ())
            .map_err(|source| ArchiveError::Zip { path, source })
    }
}
