//! Whether another process has a file open, also in another container: the kernel knows.
//!
//! Linux grants a write lease on a file to its owner only while nobody else has it open (`fcntl`, `F_SETLEASE`). Shared memory
//! without a size is open in its maker from the instant at which it has a name, so what nobody has open has no living maker.

use std::fs::File;
use std::io;
use std::os::fd::AsRawFd;

/// `F_SETSIG` of `asm-generic/fcntl.h`: the signal sent when another process opens the file.
const SET_SIGNAL: libc::c_int = 10;

/// A write lease (`fcntl`, `F_SETLEASE`): no other process has the file open; one that opens it blocks, or gets `EWOULDBLOCK`, until
/// this is dropped.
#[derive(Debug)]
pub(super) struct WriteLease<'a>(&'a File);

impl<'a> WriteLease<'a> {
    /// The file, opened by this process for writing, if nobody else has it open.
    ///
    /// # Errors
    /// [`io::ErrorKind::WouldBlock`] where somebody has; anything else where the system has no leases for it.
    pub(super) fn of(file: &'a File) -> io::Result<Self> {
        // Somebody who opens it meanwhile has a signal sent here. The usual one, SIGIO, would end the process; this one is ignored
        // by processes that have not asked for it.
        set(file, SET_SIGNAL, libc::SIGURG)?;
        set(file, libc::F_SETLEASE, libc::F_WRLCK)?;
        Ok(Self(file))
    }
}

impl Drop for WriteLease<'_> {
    fn drop(&mut self) {
        // Closing the file would do as well.
        let _ = set(self.0, libc::F_SETLEASE, libc::F_UNLCK);
    }
}

#[allow(unsafe_code)]
fn set(file: &File, what: libc::c_int, value: libc::c_int) -> io::Result<()> {
    // SAFETY: both operations take a number, and the file is open.
    match unsafe { libc::fcntl(file.as_raw_fd(), what, value) } {
        -1 => Err(io::Error::last_os_error()),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use std::fs::OpenOptions;
    use std::os::unix::fs::OpenOptionsExt;

    use super::*;

    #[test]
    fn a_file_that_somebody_else_has_open_is_not_ours_alone() {
        let folder = tempfile::tempdir_in("/dev/shm").unwrap();
        let path = folder.path().join("memory");
        let mut making = OpenOptions::new();
        let making = making.read(true).write(true).create_new(true).mode(0o200);
        let maker = making.open(&path).unwrap();
        let file = OpenOptions::new().write(true).open(&path).unwrap();
        let refused = WriteLease::of(&file).unwrap_err();
        assert_eq!(refused.kind(), io::ErrorKind::WouldBlock);
        drop(maker);
        let sole = WriteLease::of(&file).unwrap();
        let mut opening = OpenOptions::new();
        let opening = opening.write(true).custom_flags(libc::O_NONBLOCK);
        let refused = opening.open(&path).unwrap_err();
        assert_eq!(refused.kind(), io::ErrorKind::WouldBlock);
        drop(sole);
        opening.open(&path).unwrap();
    }
}
