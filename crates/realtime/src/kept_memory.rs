//! Memory that outlives the process: a file that is mapped.

use std::fs::OpenOptions;
use std::io;
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::ptr::{self, NonNull};
use std::slice;
use std::sync::atomic::AtomicU64;

use rustix::fs::{FallocateFlags, fallocate};
use rustix::mm::{MapFlags, ProtFlags, mmap, munmap};

/// A mapped file of 64-bit words: what is stored in them is there for the next process that opens the file, however this one ends, and
/// storing takes no system call. When the machine ends, what is stored last may be lost.
///
/// At most one process may write at a time. One that is killed leaves each word as it was before or after a store, and its stores with
/// [`std::sync::atomic::Ordering::Release`] in the order in which they were made.
pub struct KeptMemory {
    words: NonNull<AtomicU64>,
    count: usize,
}

// SAFETY: the mapping belongs to this value alone and is read and written through atomics only.
unsafe impl Send for KeptMemory {}

impl KeptMemory {
    /// Opens the file at `path`, or creates it for this user alone, and maps its first `count` words; new ones are zero.
    ///
    /// # Errors
    /// The system's, where the file cannot be created, sized or mapped.
    pub fn open(path: &Path, count: usize) -> io::Result<Self> {
        let file = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .mode(0o600)
            .open(path)?;
        let bytes = count * size_of::<AtomicU64>();
        // Its memory is taken now: a page that a full disk has none left for would end the process when it is written.
        fallocate(&file, FallocateFlags::empty(), 0, bytes as u64)?;
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

impl Drop for KeptMemory {
    fn drop(&mut self) {
        let bytes = self.count * size_of::<AtomicU64>();
        // SAFETY: the mapping made in `open`, given back once. It cannot fail for a range that is mapped.
        let _ = unsafe { munmap(self.words.as_ptr().cast(), bytes) };
    }
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
        let memory = KeptMemory::open(&path, 1000).unwrap();
        assert!(
            memory
                .words()
                .iter()
                .all(|word| word.load(Ordering::Relaxed) == 0)
        );
        memory.words()[999].store(7, Ordering::Release);
        drop(memory);
        let memory = KeptMemory::open(&path, 1000).unwrap();
        assert_eq!(memory.words()[999].load(Ordering::Acquire), 7);
        let mode = std::fs::metadata(&path).unwrap().permissions().mode();
        assert_eq!(mode & 0o777, 0o600);
    }

    #[test]
    fn a_path_that_cannot_be_opened_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        assert!(KeptMemory::open(folder.path(), 1).is_err());
    }
}
