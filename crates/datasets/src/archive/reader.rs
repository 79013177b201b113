//! Reading archives.

use super::error::ArchiveError;
use super::layout::{check_expansion, check_layout, check_versions, end_record};
use arrays::{NpyArray, NpyError, Number};
use input_files::{InputFile, InputFileError};
use std::collections::BTreeMap;
use std::fmt::Display;
use std::fs::File;
use std::io::{BufReader, Read, copy, sink};
use std::path::{Path, PathBuf};
use zip::ZipArchive;
use zip::read::ZipFile;

/// Longest archive that is read, bytes.
pub(crate) const MAX_ARCHIVE_BYTES: u64 = 1 << 38;

/// What the header of an array tells.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Header {
    /// Type of the values, such as `<f4`.
    descr: String,
    shape: Vec<u64>,
}

/// Reads named arrays.
///
/// Opening it looks at the headers of all of them, so that shapes can be compared before a value is read.
pub struct ArchiveReader {
    path: PathBuf,
    zip: ZipArchive<BufReader<File>>,
    headers: BTreeMap<String, Header>,
}

impl ArchiveReader {
    /// Opens an archive, and reads the headers of its arrays.
    ///
    /// # Errors
    /// [`ArchiveError`] where it is not an archive of arrays, or has bytes that belong to none.
    pub fn open(path: &Path) -> Result<Self, ArchiveError> {
        let file = InputFile::open(path, MAX_ARCHIVE_BYTES)?;
        let size = file.size();
        let mut file = file.into_file();
        let end = end_record(&mut file, size).map_err(|source| InputFileError::Unreadable {
            path: path.into(),
            source,
        })?;
        let raw = file.try_clone().map_err(|e| damaged(path, e))?;
        let mut zip = ZipArchive::new(BufReader::new(file)).map_err(|e| damaged(path, e))?;
        zip.validate_header_consistency()
            .map_err(|e| damaged(path, e))?;
        check_versions(&mut zip, &raw)
            .and_then(|()| check_layout(&mut zip, size, &end))
            .and_then(|()| check_expansion(&mut zip, size))
            .map_err(|e| damaged(path, e))?;
        let mut archive = Self {
            path: path.into(),
            zip,
            headers: BTreeMap::new(),
        };
        for index in 0..archive.zip.len() {
            let (name, header) = archive.header(index)?;
            archive.headers.insert(name, header);
        }
        Ok(archive)
    }

    fn header(&mut self, index: usize) -> Result<(String, Header), ArchiveError> {
        let refused = |reason: &dyn Display| damaged(&self.path, reason);
        let member = self.zip.by_index(index).map_err(|e| refused(&e))?;
        let name = member.name().map_err(|e| refused(&e))?.into_owned();
        let Some(array) = name.strip_suffix(".npy") else {
            return Err(refused(&format!(
                "member `{name}` is not an array, NAME.npy"
            )));
        };
        let array = array.to_owned();
        let header = open_member(member).map(|opened| Header {
            descr: opened.descr().to_owned(),
            shape: opened.shape().to_vec(),
        });
        let header = header.map_err(|error| self.wrong(&array, error.to_string()))?;
        Ok((array, header))
    }

    /// The archive.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether the archive holds an array of that name.
    #[must_use]
    pub fn has(&self, array: &str) -> bool {
        self.headers.contains_key(array)
    }

    /// The name and the shape of each array.
    pub fn shapes(&self) -> impl Iterator<Item = (&str, &[u64])> {
        let headers = self.headers.iter();
        headers.map(|(name, header)| (name.as_str(), header.shape.as_slice()))
    }

    /// The shape of an array.
    ///
    /// # Errors
    /// [`ArchiveError::Array`] if it is missing.
    pub fn shape(&self, array: &str) -> Result<&[u64], ArchiveError> {
        Ok(&self.known(array)?.shape)
    }

    /// The type of an array's values as NumPy names it, such as `<f4`.
    ///
    /// # Errors
    /// [`ArchiveError::Array`] if it is missing.
    pub fn descr(&self, array: &str) -> Result<&str, ArchiveError> {
        Ok(&self.known(array)?.descr)
    }

    fn known(&self, array: &str) -> Result<&Header, ArchiveError> {
        self.headers.get(array).ok_or_else(|| {
            let known = self.headers.keys().collect::<Vec<_>>();
            let reason = format!("it is missing, and needed; there are {known:?}");
            self.wrong(array, reason)
        })
    }

    /// Checks the shape of an array; no value is read.
    ///
    /// # Errors
    /// [`ArchiveError::Array`] if it is missing or has another shape.
    pub fn expect_shape(&self, array: &str, expected: &[usize]) -> Result<(), ArchiveError> {
        let found = self.shape(array)?;
        let is_same = found.len() == expected.len()
            && found.iter().zip(expected).all(|(a, b)| *a == *b as u64);
        if is_same {
            return Ok(());
        }
        let reason = format!("it has shape {found:?}, {expected:?} is needed");
        Err(self.wrong(array, reason))
    }

    /// Checks the type of an array's values; no value is read.
    ///
    /// # Errors
    /// [`ArchiveError::Array`] if it is missing or of none of these types, `<f4` as NumPy writes it.
    pub fn expect_type(&self, array: &str, allowed: &[&str]) -> Result<(), ArchiveError> {
        let found = self.descr(array)?;
        if allowed.contains(&found) {
            return Ok(());
        }
        let reason = format!("it holds {found}; {} is needed", allowed.join(" or "));
        Err(self.wrong(array, reason))
    }

    /// The error that says what is wrong with an array, and what is allowed.
    #[must_use]
    pub fn wrong(&self, array: &str, reason: String) -> ArchiveError {
        ArchiveError::Array {
            path: self.path.clone(),
            array: array.into(),
            reason,
        }
    }

    /// Reads one array in row-major order, with its shape; its checksum holds.
    ///
    /// # Errors
    /// [`ArchiveError::Array`] if it is missing, damaged, or not of type `T`.
    pub fn read<T: Number>(&mut self, array: &str) -> Result<(Vec<T>, Vec<u64>), ArchiveError> {
        let shape = self.shape(array)?.to_vec();
        let member = self.zip.by_name(&format!("{array}.npy"));
        let values = member
            .map_err(|error| NpyError::Header(error.to_string()))
            .and_then(open_member)
            .and_then(NpyArray::into_vec);
        let values = values.map_err(|error| self.wrong(array, error.to_string()))?;
        Ok((values, shape))
    }

    /// Reads every array to its end without keeping it, so that the checksums of those that nobody reads hold, too.
    ///
    /// # Errors
    /// [`ArchiveError::Array`], naming the first that is damaged.
    pub fn check_all(&mut self) -> Result<(), ArchiveError> {
        for array in self.headers.keys() {
            let member = self.zip.by_name(&format!("{array}.npy"));
            let read = member
                .map_err(std::io::Error::from)
                .and_then(|mut member| copy(&mut member, &mut sink()));
            read.map_err(|error| self.wrong(array, NpyError::Values(error).to_string()))?;
        }
        Ok(())
    }
}

fn damaged(path: &Path, reason: impl Display) -> ArchiveError {
    ArchiveError::Zip {
        path: path.into(),
        reason: reason.to_string(),
    }
}

fn open_member<R: Read>(member: ZipFile<'_, R>) -> Result<NpyArray<ZipFile<'_, R>>, NpyError> {
    let size = member.size();
    NpyArray::open(member, size)
}
