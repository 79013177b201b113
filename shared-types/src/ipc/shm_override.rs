//! Overrides `shm_open` and `shm_unlink`: shared memory that another user made does not exist for this process.
//!
//! The names of all users' shared memory lie in one folder, `/dev/shm`, in which anybody may make any name that is free.
//! iceoryx2 0.10.0 looks at names alone. Another user can make a file with the name of a connection of one of our processes.
//! iceoryx2 would map that file, or wait for it without end where it is empty. It could never remove it, so that a dead process of
//! ours would keep its place for ever.
//!
//! The two functions of the C library through which iceoryx2 reaches names are therefore defined here, with two rules more:
//!
//! - What another user made is not there, and a name that another user has taken cannot be made.
//! - A service's memory that has no size yet counts as memory that may not be read yet. iceoryx2 waits
//!   for such memory up to its creation timeout, but for a size without end.
//!
//! The linker takes a program's own definition before a shared library's.

use std::ffi::{CStr, OsStr, c_char, c_int};
use std::os::fd::{IntoRawFd, OwnedFd};
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};

use rustix::fs::{AtFlags, CWD, Mode, OFlags, fstat, open, statat, unlink};
use rustix::io::Errno;
use rustix::process::geteuid;

/// Where POSIX shared memory has its names.
pub(super) const FOLDER: &str = "/dev/shm";
/// Ends the names of the memory of services, without which nobody can use one.
const SERVICES_END: &str = "dynamic";

/// Opens or makes shared memory as POSIX says, but never another user's.
///
/// Returns a file descriptor, or −1 and the reason in `errno`: `ENOENT` also where the memory is another user's, `EACCES`
/// also where it was to be made and another user has taken the name, and where it is a service's and its maker has not come to giving
/// it a size.
///
/// # Safety
/// `name` points to a string that ends with a zero byte.
#[allow(unsafe_code, reason = "the C library's signature")]
#[unsafe(no_mangle)]
pub(super) unsafe extern "C" fn shm_open(
    name: *const c_char,
    flags: c_int,
    mode: libc::mode_t,
) -> c_int {
    // SAFETY: the caller's promise.
    let path = path_of(unsafe { CStr::from_ptr(name) });
    let flags = OFlags::from_bits_retain(flags.cast_unsigned());
    match path.and_then(|path| open_own(&path, flags, Mode::from_raw_mode(mode))) {
        Ok(file) => file.into_raw_fd(),
        Err(error) => fail(error),
    }
}

/// Removes the name of shared memory as POSIX says, but never another user's.
///
/// Returns 0, or −1 and the reason in `errno`: `ENOENT` also where the memory is another user's.
///
/// # Safety
/// `name` points to a string that ends with a zero byte.
#[allow(unsafe_code, reason = "the C library's signature")]
#[unsafe(no_mangle)]
pub(super) unsafe extern "C" fn shm_unlink(name: *const c_char) -> c_int {
    // SAFETY: the caller's promise.
    let path = path_of(unsafe { CStr::from_ptr(name) });
    let remove = |path: PathBuf| match is_foreign(&path) {
        true => Err(Errno::NOENT),
        false => unlink(&path),
    };
    match path.and_then(remove) {
        Ok(()) => 0,
        Err(error) => fail(error),
    }
}

fn path_of(name: &CStr) -> Result<PathBuf, Errno> {
    let name = name.to_bytes();
    let name = name.strip_prefix(b"/").unwrap_or(name);
    if name.is_empty() || name.contains(&b'/') || [&b"."[..], b".."].contains(&name) {
        return Err(Errno::INVAL);
    }
    Ok(PathBuf::from(FOLDER).join(OsStr::from_bytes(name)))
}

fn open_own(path: &PathBuf, flags: OFlags, mode: Mode) -> Result<OwnedFd, Errno> {
    // Without NONBLOCK another user's named pipe would be waited for.
    let flags = flags | OFlags::NOFOLLOW | OFlags::CLOEXEC | OFlags::NONBLOCK;
    let foreign = if flags.contains(OFlags::CREATE) {
        Errno::ACCESS
    } else {
        Errno::NOENT
    };
    let opened = open(path, flags, mode).and_then(|file| Ok((fstat(&file)?, file)));
    match opened {
        Ok((data, _)) if data.st_uid != geteuid().as_raw() => Err(foreign),
        Ok((data, _)) if data.st_size == 0 && is_only_opened(path, flags) => Err(Errno::ACCESS),
        Ok((_, file)) => Ok(file),
        // Somebody finds out whether its maker lives.
        Err(Errno::WOULDBLOCK) => Err(Errno::ACCESS),
        Err(_) if is_foreign(path) => Err(foreign),
        Err(error) => Err(error),
    }
}

/// Whether somebody opens the memory of a service that another process makes.
fn is_only_opened(path: &Path, flags: OFlags) -> bool {
    !flags.contains(OFlags::CREATE) && path.extension().is_some_and(|end| end == SERVICES_END)
}

fn is_foreign(path: &PathBuf) -> bool {
    let data = statat(CWD, path, AtFlags::SYMLINK_NOFOLLOW);
    data.is_ok_and(|data| data.st_uid != geteuid().as_raw())
}

#[allow(unsafe_code)]
fn fail(error: Errno) -> c_int {
    // SAFETY: the address of this thread's error number is always valid.
    unsafe { *libc::__errno_location() = error.raw_os_error() };
    -1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn iceoryx2_calls_these_and_not_the_c_librarys() {
        let called: unsafe extern "C" fn(*const c_char, c_int, libc::mode_t) -> c_int =
            libc::shm_open;
        assert!(std::ptr::fn_addr_eq(
            called,
            shm_open as unsafe extern "C" fn(_, _, _) -> _
        ));
        let called: unsafe extern "C" fn(*const c_char) -> c_int = libc::shm_unlink;
        assert!(std::ptr::fn_addr_eq(
            called,
            shm_unlink as unsafe extern "C" fn(_) -> _
        ));
    }

    #[test]
    fn names_are_checked_and_shm_override_is_made_once_opened_and_removed() {
        let random = tempfile::tempdir().unwrap();
        let name = format!(
            "/pcc-own-memory{}",
            random.path().to_str().unwrap().replace('/', "-")
        );
        let path = path_of(&std::ffi::CString::new(name).unwrap()).unwrap();
        let exclusive = OFlags::RDWR | OFlags::CREATE | OFlags::EXCL;
        let owner = Mode::RUSR | Mode::WUSR;
        assert_eq!(
            open_own(&path, OFlags::RDWR, owner).unwrap_err(),
            Errno::NOENT
        );
        open_own(&path, exclusive, owner).unwrap();
        assert_eq!(open_own(&path, exclusive, owner).unwrap_err(), Errno::EXIST);
        open_own(&path, OFlags::RDWR, owner).unwrap();
        unlink(&path).unwrap();
        for name in [c"/", c"", c"/a/b", c"/..", c"."] {
            assert_eq!(path_of(name).unwrap_err(), Errno::INVAL, "{name:?}");
        }
    }
}
