//! Regular files of bounded size, as bytes or as text.

use rustix::fs::OFlags;
use std::fs::{File, FileType, Metadata, OpenOptions};
use std::io::{self, Read};
use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use thiserror::Error;

use crate::text::shown;

/// Why a file is not read.
#[derive(Debug, Error)]
pub enum InputFileError {
    /// The system refuses to open or to read the file.
    #[error("cannot read {}, and a file that can be read is needed: {source}", shown(.path))]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The system's answer.
        source: io::Error,
    },
    /// The file is a folder, a pipe, a socket or a device.
    #[error("cannot read {}: it is {kind}; a regular file is needed", shown(.path))]
    Kind {
        /// The file.
        path: PathBuf,
        /// What the file is, with the article: `a folder`.
        kind: &'static str,
    },
    /// The file is longer than what is read of such a file.
    #[error("cannot read {}: it has {size} bytes; at most {most} are allowed", shown(.path))]
    Size {
        /// The file.
        path: PathBuf,
        /// The file's size, or as much of it as was looked at, bytes.
        size: u64,
        /// The most bytes that are read.
        most: u64,
    },
    /// The file is not text.
    #[error("cannot read {}: it is not UTF-8 at byte {at}; text in UTF-8 is needed", shown(.path))]
    Text {
        /// The file.
        path: PathBuf,
        /// Bytes before the first that is not understood.
        at: usize,
    },
}

/// A regular file that is open for reading, of bounded size.
#[derive(Debug)]
pub struct InputFile {
    file: File,
    size: u64,
}

impl InputFile {
    /// Opens a regular file of at most `most` bytes, without waiting for anything.
    ///
    /// # Errors
    /// [`InputFileError`], naming the file and what is allowed.
    pub fn open(path: &Path, most: u64) -> Result<Self, InputFileError> {
        let unreadable = |source| InputFileError::Unreadable {
            path: path.into(),
            source,
        };
        // Opening a device can do something: it is looked at before, and again once it is open.
        check_kind(path, &path.metadata().map_err(unreadable)?)?;
        let flags = OFlags::NONBLOCK | OFlags::NOCTTY;
        let file = OpenOptions::new()
            .read(true)
            .custom_flags(flags.bits().cast_signed())
            .open(path)
            .map_err(unreadable)?;
        let metadata = file.metadata().map_err(unreadable)?;
        check_kind(path, &metadata)?;
        let size = metadata.len();
        check_size(path, size, most)?;
        Ok(Self { file, size })
    }

    /// Its size when it was opened, bytes.
    #[must_use]
    pub fn size(&self) -> u64 {
        self.size
    }

    /// The open file, at its first byte.
    #[must_use]
    pub fn into_file(self) -> File {
        self.file
    }
}

fn check_kind(path: &Path, metadata: &Metadata) -> Result<(), InputFileError> {
    match kind_of(metadata.file_type()) {
        None => Ok(()),
        Some(kind) => Err(InputFileError::Kind {
            path: path.into(),
            kind,
        }),
    }
}

/// What a file is that is not a regular one.
fn kind_of(found: FileType) -> Option<&'static str> {
    let kinds = [
        (found.is_dir(), "a folder"),
        (found.is_fifo(), "a named pipe"),
        (found.is_socket(), "a socket"),
        (found.is_char_device(), "a device"),
        (found.is_block_device(), "a disk"),
        (!found.is_file(), "no file"),
    ];
    let kind = kinds.into_iter().find(|(is_it, _)| *is_it);
    kind.map(|(_, kind)| kind)
}

fn check_size(path: &Path, size: u64, most: u64) -> Result<(), InputFileError> {
    if size <= most {
        return Ok(());
    }
    Err(InputFileError::Size {
        path: path.into(),
        size,
        most,
    })
}

/// Reads a regular file of at most `most` bytes.
///
/// # Errors
/// [`InputFileError`], naming the file and what is allowed.
pub fn read_bytes(path: &Path, most: u64) -> Result<Vec<u8>, InputFileError> {
    let mut bytes = Vec::new();
    let file = InputFile::open(path, most)?.into_file();
    // It may have grown since, and some files of the system have no size at all.
    let reading = file.take(most.saturating_add(1)).read_to_end(&mut bytes);
    reading.map_err(|source| InputFileError::Unreadable {
        path: path.into(),
        source,
    })?;
    check_size(path, bytes.len() as u64, most)?;
    Ok(bytes)
}

/// Reads a regular file of at most `most` bytes as text.
///
/// # Errors
/// [`InputFileError`], naming the file, the place and what is allowed.
pub fn read_text(path: &Path, most: u64) -> Result<String, InputFileError> {
    String::from_utf8(read_bytes(path, most)?).map_err(|error| InputFileError::Text {
        path: path.into(),
        at: error.utf8_error().valid_up_to(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::os::unix::fs::symlink;
    use std::os::unix::net::UnixListener;

    #[test]
    fn what_is_read_is_the_whole_file() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a");
        fs::write(&file, "größer").unwrap();
        assert_eq!(read_text(&file, 8).unwrap(), "größer");
        let link = folder.path().join("link");
        symlink(&file, &link).unwrap();
        assert_eq!(read_bytes(&link, 8).unwrap().len(), 8);
        assert_eq!(InputFile::open(&link, 8).unwrap().size(), 8);
    }

    #[test]
    fn what_is_no_regular_file_is_refused_by_its_kind_without_waiting() {
        let folder = tempfile::tempdir().unwrap();
        let (pipe, socket) = (folder.path().join("pipe"), folder.path().join("socket"));
        let mode = rustix::fs::Mode::RUSR | rustix::fs::Mode::WUSR;
        rustix::fs::mkfifoat(rustix::fs::CWD, &pipe, mode).unwrap();
        let _listener = UnixListener::bind(&socket).unwrap();
        for (path, kind) in [
            (folder.path(), "a folder"),
            (&pipe, "a named pipe"),
            (&socket, "a socket"),
            (Path::new("/dev/zero"), "a device"),
            (Path::new("/dev/null"), "a device"),
        ] {
            let error = read_bytes(path, 10).unwrap_err().to_string();
            assert!(error.contains(kind), "{error}");
            assert!(error.contains(path.to_str().unwrap()), "{error}");
            assert!(error.contains("a regular file is needed"), "{error}");
        }
    }

    #[test]
    fn what_is_too_long_or_no_text_is_refused_with_what_is_allowed() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a");
        File::create(&file).unwrap().set_len(1 << 40).unwrap();
        let error = read_bytes(&file, 100).unwrap_err().to_string();
        let said = "it has 1099511627776 bytes; at most 100 are allowed";
        assert!(error.contains(said), "{error}");
        fs::write(&file, b"ab\xff").unwrap();
        let error = read_text(&file, 100).unwrap_err().to_string();
        assert!(error.contains("not UTF-8 at byte 2"), "{error}");
        fs::remove_file(&file).unwrap();
        assert!(matches!(
            read_bytes(&file, 100),
            Err(InputFileError::Unreadable { .. })
        ));
        // A file of the system says that it has no byte.
        let error = read_bytes(Path::new("/proc/self/status"), 100).unwrap_err();
        assert!(matches!(error, InputFileError::Size { size: 101, .. }));
    }
}
