//! The folder of service files and locks, which must be one user's alone.
//!
//! Who can open a lock file can hold its lock, and with it every process that wants it; who can replace the folder can
//! put another in its place. Both are looked for at each start.

use std::fs::{self, File, OpenOptions, Permissions};
use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::Path;

use rustix::fs::OFlags;
use rustix::process::geteuid;

use super::IpcError;

/// Mode of the root folder: its owner alone may list, enter and change it.
const FOLDER_MODE: u32 = 0o700;
/// Mode of a file in the root folder: its owner alone may read and write it.
const FILE_MODE: u32 = 0o600;
const PERMISSION_BITS: u32 = 0o777;
const WRITABLE_BY_OTHERS: u32 = 0o022;
/// Only the owner of an entry may remove or rename it.
const STICKY: u32 = 0o1000;

/// Makes the folder where it is missing, and checks that it is this user's alone and stays in its place.
///
/// # Errors
/// [`IpcError::Root`] where it cannot be made, is no folder, a symbolic link or a relative path,
/// [`IpcError::ForeignRoot`], [`IpcError::OpenRoot`] or [`IpcError::ReplaceableRoot`].
pub(super) fn prepare(path: &Path) -> Result<(), IpcError> {
    let failed = |source| IpcError::Root {
        path: path.to_owned(),
        source,
    };
    if !path.is_absolute() {
        let why = "it is a relative path, so that it would name another folder for each working directory; only an absolute one is allowed";
        return Err(failed(io::Error::other(why)));
    }
    let create = || {
        let mut builder = fs::DirBuilder::new();
        builder.recursive(true).mode(FOLDER_MODE).create(path)
    };
    create().map_err(failed)?;
    let folder = fs::symlink_metadata(path).map_err(failed)?;
    if folder.is_symlink() {
        let why = "it is a symbolic link; only the folder itself is allowed";
        return Err(failed(io::Error::other(why)));
    }
    let (owner, user) = (folder.uid(), geteuid().as_raw());
    if owner != user {
        return Err(IpcError::ForeignRoot {
            path: path.to_owned(),
            owner,
            user,
        });
    }
    let mode = folder.mode() & PERMISSION_BITS;
    if mode != FOLDER_MODE {
        return Err(IpcError::OpenRoot {
            path: path.to_owned(),
            mode,
            owner,
        });
    }
    check_parents(path, user)
}

/// Whether somebody else can rename the folder, or one that it lies in, and put another in its place.
fn check_parents(path: &Path, user: u32) -> Result<(), IpcError> {
    let failed = |source| IpcError::Root {
        path: path.to_owned(),
        source,
    };
    let real = path.canonicalize().map_err(failed)?;
    // In a user namespace the system's own folders may belong to a number other than 0.
    let system = fs::metadata("/").map_err(failed)?.uid();
    for parent in real.ancestors().skip(1) {
        let data = fs::metadata(parent).map_err(failed)?;
        let (owner, mode) = (data.uid(), data.mode());
        let replaceable = mode & WRITABLE_BY_OTHERS != 0 && mode & STICKY == 0;
        if replaceable || ![user, system, 0].contains(&owner) {
            return Err(IpcError::ReplaceableRoot {
                path: path.to_owned(),
                parent: parent.to_owned(),
                mode: mode & (PERMISSION_BITS | STICKY),
                owner,
            });
        }
    }
    Ok(())
}

/// Opens a lock file, and makes it where it is missing, for this user alone; a symbolic link is refused.
///
/// # Errors
/// What the system says.
pub(super) fn open_lock_file(path: &Path) -> io::Result<File> {
    let file = OpenOptions::new()
        .read(true)
        .write(true)
        .create(true)
        .truncate(false)
        .mode(FILE_MODE)
        .custom_flags(OFlags::NOFOLLOW.bits().cast_signed())
        .open(path)?;
    if file.metadata()?.mode() & PERMISSION_BITS != FILE_MODE {
        file.set_permissions(Permissions::from_mode(FILE_MODE))?;
    }
    Ok(file)
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    #[test]
    fn the_folder_is_made_for_this_user_alone() {
        let directory = tempfile::tempdir().unwrap();
        let root = directory.path().join("deep/root");
        prepare(&root).unwrap();
        assert_eq!(fs::metadata(&root).unwrap().mode() & 0o777, 0o700);
        prepare(&root).unwrap();
    }

    #[test]
    fn a_folder_that_others_can_enter_is_refused_by_its_mode_and_owner() {
        let directory = tempfile::tempdir().unwrap();
        let root = directory.path().join("root");
        fs::create_dir(&root).unwrap();
        for mode in [0o755, 0o710, 0o701, 0o770, 0o777, 0o500] {
            fs::set_permissions(&root, Permissions::from_mode(mode)).unwrap();
            let error = prepare(&root).unwrap_err();
            let text = error.to_string();
            assert!(matches!(error, IpcError::OpenRoot { mode: found, .. } if found == mode));
            for part in [root.to_str().unwrap(), &format!("{mode:04o}"), "0700"] {
                assert!(text.contains(part), "{text}");
            }
        }
    }

    #[test]
    fn a_folder_that_others_can_replace_is_refused_by_the_folder_that_lets_them() {
        let directory = tempfile::tempdir().unwrap();
        let parent = directory.path().join("parent");
        let root = parent.join("root");
        prepare(&root).unwrap();
        for (mode, allowed) in [
            (0o777, false),
            (0o770, false),
            (0o1777, true),
            (0o755, true),
        ] {
            fs::set_permissions(&parent, Permissions::from_mode(mode)).unwrap();
            match prepare(&root) {
                Ok(()) => assert!(allowed, "{mode:o}"),
                Err(error) => {
                    assert!(!allowed && matches!(error, IpcError::ReplaceableRoot { .. }));
                    assert!(error.to_string().contains(parent.to_str().unwrap()));
                }
            }
        }
    }

    #[test]
    fn links_files_and_relative_paths_are_refused_by_name() {
        let directory = tempfile::tempdir().unwrap();
        let (real, link, file) = (
            directory.path().join("real"),
            directory.path().join("link"),
            directory.path().join("file"),
        );
        prepare(&real).unwrap();
        symlink(&real, &link).unwrap();
        fs::write(&file, "").unwrap();
        for path in [&link, &file, Path::new("relative/root")] {
            let text = prepare(path).unwrap_err().to_string();
            assert!(text.contains(path.to_str().unwrap()), "{text}");
        }
        assert!(!Path::new("relative").exists());
    }

    #[test]
    fn a_lock_file_is_its_owners_alone_and_never_a_link() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("lock");
        fs::write(&path, "").unwrap();
        fs::set_permissions(&path, Permissions::from_mode(0o666)).unwrap();
        open_lock_file(&path).unwrap();
        assert_eq!(fs::metadata(&path).unwrap().mode() & 0o777, 0o600);
        let link = directory.path().join("link");
        symlink(&path, &link).unwrap();
        open_lock_file(&link).unwrap_err();
    }
}
