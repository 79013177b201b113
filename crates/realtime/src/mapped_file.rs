//! A file mapped into memory: its contents outlive the process.

use std::fs::{File, OpenOptions};
use std::io;
use std::os::unix::fs::{FileExt, MetadataExt, OpenOptionsExt};
use std::path::Path;
use std::ptr::{self, NonNull};
use std::slice;
use std::sync::atomic::AtomicU64;

use rustix::fs::{FallocateFlags, OFlags, fallocate, statfs};
use rustix::io::Errno;
use rustix::mm::{MapFlags, ProtFlags, mmap, munmap};
use rustix::process::geteuid;

/// A mapped file of 64-bit words: what is stored in them is there for the next process that opens the file, however this one ends, and
/// storing takes no system call. When the machine ends, what is stored last may be lost.
///
/// At most one process may write at a time. One that is killed leaves each word as it was before or after a store, and its stores with
/// [`std::sync::atomic::Ordering::Release`] in the order in which they were made.
pub struct MappedFile {
    words: NonNull<AtomicU64>,
    count: usize,
}

// SAFETY: the mapping belongs to this value alone and is read and written through atomics only.
unsafe impl Send for MappedFile {}

impl MappedFile {
    /// Opens the file at `path`, or creates it for this user alone, and maps its first `count` words; new ones are zero.
    ///
    /// # Errors
    /// The system's, where the file cannot be created, sized or mapped, and where it is another user's, or a link.
    pub fn open(path: &Path, count: usize) -> io::Result<Self> {
        let file = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .mode(0o600)
            .custom_flags(OFlags::NOFOLLOW.bits().cast_signed())
            .open(path)?;
        if file.metadata()?.uid() != geteuid().as_raw() {
            return Err(io::Error::other("it is another user's"));
        }
        let bytes = count * size_of::<AtomicU64>();
        take(&file, bytes as u64)?;
        let rights = ProtFlags::READ | ProtFlags::WRITE;
        // SAFETY: a new shared mapping, at an address of the system's choice, of a file that is `bytes` long.
        let address = unsafe { mmap(ptr::null_mut(), bytes, rights, MapFlags::SHARED, &file, 0) }?;
        let words = NonNull::new(address.cast()).ok_or(io::ErrorKind::AddrNotAvailable)?;
        Ok(Self { words, count })
    }

    /// The words.
    #[must_use]
    pub fn words(&self) -> &[AtomicU64] {
        // SAFETY: mapped for as long as `self` lives, page-aligned, `count` words long; every bit pattern is an `AtomicU64`.
        unsafe { slice::from_raw_parts(self.words.as_ptr(), self.count) }
    }
}

impl Drop for MappedFile {
    fn drop(&mut self) {
        let bytes = self.count * size_of::<AtomicU64>();
        // SAFETY: the mapping made in `open`, given back once. It cannot fail for a range that is mapped.
        let _ = unsafe { munmap(self.words.as_ptr().cast(), bytes) };
    }
}

/// Takes a file's memory now: a page that a full disk has none left for would end the process when it is written.
fn take(file: &File, bytes: u64) -> io::Result<()> {
    match fallocate(file, FallocateFlags::empty(), 0, bytes) {
        Err(Errno::OPNOTSUPP) => {
            let length = file.metadata()?.len();
            let missing = usize::try_from(bytes.saturating_sub(length)).unwrap_or(usize::MAX);
            file.write_all_at(&vec![0; missing], length)
        }
        taken => Ok(taken?),
    }
}

/// Whether files in a folder are memory alone (tmpfs, ramfs), so that storing in one never waits for a disk.
///
/// # Errors
/// The system's, where it does not tell.
pub fn is_in_ram(folder: &Path) -> io::Result<bool> {
    const TMPFS: u64 = 0x0102_1994;
    const RAMFS: u64 = 0x8584_58f6;
    let kind = statfs(folder)?.f_type as u64;
    Ok([TMPFS, RAMFS].contains(&kind))
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt;
    use std::sync::atomic::Ordering;

    use super::*;

    #[test]
    fn what_was_stored_is_there_for_who_opens_the_file_next() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("memory");
        let memory = MappedFile::open(&path, 1000).unwrap();
        assert!(
            memory
                .words()
                .iter()
                .all(|word| word.load(Ordering::Relaxed) == 0)
        );
        memory.words()[999].store(7, Ordering::Release);
        drop(memory);
        let memory = MappedFile::open(&path, 1000).unwrap();
        assert_eq!(memory.words()[999].load(Ordering::Acquire), 7);
        let mode = std::fs::metadata(&path).unwrap().permissions().mode();
        assert_eq!(mode & 0o777, 0o600);
    }

    #[test]
    fn a_folder_says_whether_it_is_in_memory() {
        assert!(is_in_ram(Path::new("/dev/shm")).unwrap());
        assert!(!is_in_ram(Path::new("/proc")).unwrap());
        assert!(is_in_ram(Path::new("/no such folder")).is_err());
    }

    #[test]
    fn a_link_is_not_followed() {
        let folder = tempfile::tempdir().unwrap();
        let (file, link) = (folder.path().join("file"), folder.path().join("link"));
        std::fs::write(&file, "left alone").unwrap();
        std::os::unix::fs::symlink(&file, &link).unwrap();
        assert!(MappedFile::open(&link, 1).is_err());
        assert_eq!(std::fs::read(&file).unwrap(), b"left alone");
    }

    #[test]
    fn a_path_that_cannot_be_opened_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        assert!(MappedFile::open(folder.path(), 1).is_err());
    }
}
