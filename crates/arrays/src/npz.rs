//! Archives of named arrays: NumPy's npz, a zip file with a member `NAME.npy` for each array.

use crate::npy::{NpyArray, NpyError};
use input_files::{InputFile, InputFileError};
use npyz::{AutoSerialize, DType, Deserialize, WriterBuilder};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, BufWriter, Read, Seek, SeekFrom, copy, sink};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use thiserror::Error;
use zip::read::ZipFile;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

/// Bytes of the record that ends a zip file without a comment.
const END_RECORD: u64 = 22;
/// Longest archive that is read, bytes.
pub const MAX_ARCHIVE_BYTES: u64 = 1 << 38;
/// How many times as many bytes as the archive its arrays may have; arrays of measured numbers have less than twice as many.
const MAX_EXPANSION: u64 = 100;
/// Bytes that the arrays of any archive may have.
const SMALL: u64 = 1 << 25;
/// Versions of the format that a member may ask for: stored, compressed, larger than 4 GB.
const VERSIONS: [u16; 3] = [10, 20, 45];
/// Most bytes of a record of sizes behind a member, where its header does not tell them.
const LONGEST_DESCRIPTOR: u64 = 24;

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
        /// What is wrong.
        reason: String,
    },
    /// The archive could not be written.
    #[error("cannot write {path}: {source}")]
    Write {
        /// The archive.
        path: PathBuf,
        /// The reason.
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

/// What the header of an array tells.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Header {
    dtype: DType,
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
        let damaged = |reason: String| ArchiveError::Zip {
            path: path.into(),
            reason,
        };
        let raw = file.try_clone();
        let mut zip =
            ZipArchive::new(BufReader::new(file)).map_err(|error| damaged(error.to_string()))?;
        zip.validate_header_consistency()
            .map_err(|error| damaged(error.to_string()))?;
        raw.map_err(|error| error.to_string())
            .and_then(|raw| check_versions(&mut zip, &raw))
            .map_err(damaged)?;
        check_layout(&mut zip, size, &end).map_err(damaged)?;
        check_expansion(&mut zip, size).map_err(damaged)?;
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
        let path = self.path.clone();
        let damaged = |reason: String| ArchiveError::Zip {
            path: path.clone(),
            reason,
        };
        let member = self
            .zip
            .by_index(index)
            .map_err(|e| damaged(e.to_string()))?;
        let name = member
            .name()
            .map_err(|e| damaged(e.to_string()))?
            .into_owned();
        let Some(array) = name.strip_suffix(".npy") else {
            return Err(damaged(format!(
                "member `{name}` is not an array, NAME.npy"
            )));
        };
        let array = array.to_owned();
        let header = open_member(member).map(|opened| Header {
            dtype: opened.dtype(),
            shape: opened.shape().to_vec(),
        });
        match header {
            Ok(header) => Ok((array, header)),
            Err(error) => Err(self.wrong(&array, error.to_string())),
        }
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

    /// The type of an array's values.
    ///
    /// # Errors
    /// [`ArchiveError::Array`] if it is missing.
    pub fn dtype(&self, array: &str) -> Result<&DType, ArchiveError> {
        Ok(&self.known(array)?.dtype)
    }

    fn known(&self, array: &str) -> Result<&Header, ArchiveError> {
        self.headers.get(array).ok_or_else(|| ArchiveError::Array {
            path: self.path.clone(),
            array: array.into(),
            reason: format!(
                "it is missing, and needed; there are {:?}",
                self.headers.keys().collect::<Vec<_>>()
            ),
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
        Err(ArchiveError::Array {
            path: self.path.clone(),
            array: array.into(),
            reason: format!("it has shape {found:?}, {expected:?} is needed"),
        })
    }

    /// Checks the type of an array's values; no value is read.
    ///
    /// # Errors
    /// [`ArchiveError::Array`] if it is missing or of none of these types, `<f4` as NumPy writes it.
    pub fn expect_type(&self, array: &str, allowed: &[&str]) -> Result<(), ArchiveError> {
        let Header { dtype, .. } = self.known(array)?;
        let found = dtype.descr();
        let found = found.trim_matches('\'');
        if allowed.contains(&found) {
            return Ok(());
        }
        Err(ArchiveError::Array {
            path: self.path.clone(),
            array: array.into(),
            reason: format!("it holds {found}; {} is needed", allowed.join(" or ")),
        })
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
    pub fn read<T: Deserialize>(
        &mut self,
        array: &str,
    ) -> Result<(Vec<T>, Vec<u64>), ArchiveError> {
        let shape = self.shape(array)?.to_vec();
        let member = self.zip.by_name(&format!("{array}.npy"));
        let values = member
            .map_err(|error| NpyError::Header(error.to_string()))
            .and_then(open_member)
            .and_then(NpyArray::into_vec);
        match values {
            Ok(values) => Ok((values, shape)),
            Err(error) => Err(self.wrong(array, error.to_string())),
        }
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
            if let Err(error) = read {
                return Err(self.wrong(array, NpyError::Values(error).to_string()));
            }
        }
        Ok(())
    }
}

fn open_member<R: Read>(member: ZipFile<'_, R>) -> Result<NpyArray<ZipFile<'_, R>>, NpyError> {
    let size = member.size();
    NpyArray::open(member, size)
}

/// The record that ends a zip file.
struct EndRecord {
    is_there: bool,
    /// Bytes of the directory before it; none where another record tells them (zip64).
    directory: Option<u64>,
}

/// Reads the last bytes of a file as such a record.
fn end_record(file: &mut File, size: u64) -> std::io::Result<EndRecord> {
    let mut record = [0; END_RECORD as usize];
    if size >= END_RECORD {
        file.seek(SeekFrom::Start(size - END_RECORD))?;
        file.read_exact(&mut record)?;
        file.rewind()?;
    }
    let [.., a, b, c, d, _, _, _, _, low, high] = record;
    let directory = u32::from_le_bytes([a, b, c, d]);
    Ok(EndRecord {
        is_there: record.starts_with(b"PK\x05\x06") && [low, high] == [0, 0],
        directory: (directory != u32::MAX).then_some(u64::from(directory)),
    })
}

/// Refuses a member whose two headers name a version of the format that no archive of arrays needs: nothing else tells that they
/// are damaged.
fn check_versions(zip: &mut ZipArchive<BufReader<File>>, raw: &File) -> Result<(), String> {
    for index in 0..zip.len() {
        let member = zip.by_index_raw(index).map_err(|error| error.to_string())?;
        for at in [member.header_start() + 4, member.central_header_start() + 6] {
            let mut version = [0; 2];
            raw.read_exact_at(&mut version, at)
                .map_err(|error| error.to_string())?;
            let version = u16::from_le_bytes(version);
            if !VERSIONS.contains(&version) {
                return Err(format!(
                    "byte {at} asks for version {version} of the format; {VERSIONS:?} are allowed"
                ));
            }
        }
    }
    Ok(())
}

/// Refuses bytes that belong to no member: before, between and behind them.
fn check_layout(
    zip: &mut ZipArchive<BufReader<File>>,
    size: u64,
    end: &EndRecord,
) -> Result<(), String> {
    let mut members = Vec::with_capacity(zip.len());
    for index in 0..zip.len() {
        let member = zip.by_index_raw(index).map_err(|error| error.to_string())?;
        let data = member.data_start().unwrap_or(u64::MAX);
        let end = data.saturating_add(member.compressed_size());
        let has_descriptor = member.flags().is_using_data_descriptor();
        let behind = if has_descriptor {
            LONGEST_DESCRIPTOR
        } else {
            0
        };
        members.push((member.header_start(), end, behind));
    }
    members.sort_unstable();
    let directory = zip.central_directory_start();
    let (mut from, mut allowed) = (0, 0);
    for (start, end, behind) in members.into_iter().chain([(directory, directory, 0)]) {
        if start < from {
            return Err(format!("byte {start} belongs to two of its arrays"));
        }
        if start > from + allowed {
            return Err(format!(
                "bytes {from} to {start} belong to none of its arrays"
            ));
        }
        (from, allowed) = (end, behind);
    }
    let ends = end
        .directory
        .is_none_or(|bytes| directory + bytes + END_RECORD == size);
    if zip.offset() != 0 || !end.is_there || !ends {
        return Err("there are bytes behind its directory".into());
    }
    Ok(())
}

/// Refuses an archive that a few bytes make endless: it would take the memory of whatever reads it.
fn check_expansion(zip: &mut ZipArchive<BufReader<File>>, size: u64) -> Result<(), String> {
    let mut total = 0_u64;
    for index in 0..zip.len() {
        let member = zip.by_index_raw(index).map_err(|error| error.to_string())?;
        total = total.saturating_add(member.size());
    }
    let most = size.saturating_mul(MAX_EXPANSION).max(SMALL);
    if total <= most {
        return Ok(());
    }
    Err(format!(
        "its arrays have {total} bytes in a file of {size}; at most {most}, {MAX_EXPANSION} times as many, are allowed"
    ))
}

/// Writes named arrays; the file appears whole, or not at all.
pub struct ArchiveWriter {
    path: PathBuf,
    part: PartFile,
    zip: ZipWriter<BufWriter<File>>,
}

/// Where an archive is written before it is whole; of this process alone. Removed when dropped.
struct PartFile(PathBuf);

impl Drop for PartFile {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}

impl ArchiveWriter {
    /// Starts an archive beside `path`; [`finish`](Self::finish) puts it there, in place of a file of that name.
    ///
    /// # Errors
    /// [`ArchiveError::Write`].
    pub fn create(path: &Path) -> Result<Self, ArchiveError> {
        let mut name = path.file_name().unwrap_or_default().to_owned();
        name.push(format!(".{}.part", std::process::id()));
        let part = path.with_file_name(name);
        let file = File::create(&part).map_err(|source| ArchiveError::Write {
            path: path.into(),
            source,
        })?;
        Ok(Self {
            path: path.into(),
            part: PartFile(part),
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

    /// Ends the archive and gives it its name.
    ///
    /// # Errors
    /// [`ArchiveError::Write`].
    pub fn finish(self) -> Result<(), ArchiveError> {
        let Self { path, part, zip } = self;
        let written = zip
            .finish()
            .map_err(std::io::Error::from)
            .and_then(|buffered| {
                buffered.into_inner()?;
                Ok(())
            })
            .and_then(|()| std::fs::rename(&part.0, &path));
        written.map_err(|source| ArchiveError::Write { path, source })
    }
}
