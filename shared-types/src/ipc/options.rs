//! Where the services live.

use std::env;
use std::fs;
use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt};
use std::path::{Path, PathBuf};
use std::time::Duration;

use iceoryx2::config::Config;
use iceoryx2::prelude::{FileName, Path as IoxPath, SemanticString};
use rustix::process::getuid;

use super::IpcError;

/// How long a service may take to be made: some milliseconds, and the stalls of a busy machine.
const CREATION_TIMEOUT: Duration = Duration::from_millis(100);

/// Most bytes of root and prefix together: iceoryx2 makes the paths of sockets of them, with a number of up to 39 digits,
/// and such a path has 107 at most.
pub const LONGEST_ROOT_AND_PREFIX: usize = 107 - "/_.event".len() - 39;

/// Prefix and root directory that all processes of one robot share.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct IpcOptions {
    /// Begins the name of every service and of every shared memory file; default `pcc`. Two robots on one machine
    /// need two prefixes.
    pub prefix: String,
    /// Directory for service files and locks, best on a tmpfs; default `/dev/shm/pcc-<user id>`, or the same under
    /// `/tmp` where there is no `/dev/shm`. It is created for this user alone. With the prefix it has at most
    /// [`LONGEST_ROOT_AND_PREFIX`] bytes.
    pub root: PathBuf,
}

impl IpcOptions {
    /// `PCC_PREFIX` and `PCC_ROOT` of the environment, or the defaults.
    #[must_use]
    pub fn from_env() -> Self {
        Self {
            prefix: env::var("PCC_PREFIX").unwrap_or_else(|_| "pcc".to_owned()),
            root: env::var_os("PCC_ROOT").map_or_else(default_root, PathBuf::from),
        }
    }

    /// The full name of a service.
    #[must_use]
    pub fn service_name(&self, service: &str) -> String {
        format!("{}/{service}", self.prefix)
    }

    /// The lock file of a role, or of what else one process at a time may do.
    pub(super) fn lock_file(&self, role: &str) -> PathBuf {
        self.root.join(format!("{}.{role}.lock", self.prefix))
    }

    /// Checks the prefix, and makes the root directory where it is missing.
    pub(super) fn prepare(&self) -> Result<(), IpcError> {
        let allowed = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'_' || byte == b'-';
        if !(1..=32).contains(&self.prefix.len()) || !self.prefix.bytes().all(allowed) {
            return Err(IpcError::InvalidPrefix {
                prefix: self.prefix.clone(),
            });
        }
        let io = |source| IpcError::Root {
            path: self.root.clone(),
            source,
        };
        let length = self.root.as_os_str().len() + self.prefix.len();
        if length > LONGEST_ROOT_AND_PREFIX {
            return Err(io(io::Error::other(format!(
                "with the prefix it has {length} bytes, at most {LONGEST_ROOT_AND_PREFIX} are allowed"
            ))));
        }
        fs::DirBuilder::new()
            .recursive(true)
            .mode(0o700)
            .create(&self.root)
            .map_err(io)?;
        let (owner, user) = (
            fs::metadata(&self.root).map_err(io)?.uid(),
            getuid().as_raw(),
        );
        if owner != user {
            return Err(IpcError::ForeignRoot {
                path: self.root.clone(),
                owner,
                user,
            });
        }
        Ok(())
    }

    /// The iceoryx2 configuration: nothing of a system-wide configuration file has a part in it.
    pub(super) fn config(&self) -> Result<Config, IpcError> {
        let invalid_root = || IpcError::Root {
            path: self.root.clone(),
            source: io::Error::other(
                "the path is too long or has characters that iceoryx2 refuses",
            ),
        };
        let root = self
            .root
            .to_str()
            .and_then(|root| IoxPath::new(root.as_bytes()).ok())
            .ok_or_else(invalid_root)?;
        let prefix = FileName::new(format!("{}_", self.prefix).as_bytes()).map_err(|_| {
            IpcError::InvalidPrefix {
                prefix: self.prefix.clone(),
            }
        })?;
        let mut config = Config::default();
        config.global.set_root_path(&root);
        config.global.prefix = prefix;
        config.global.creation_timeout = CREATION_TIMEOUT;
        Ok(config)
    }
}

fn default_root() -> PathBuf {
    let tmpfs = Path::new("/dev/shm");
    let parent = if tmpfs.is_dir() {
        tmpfs
    } else {
        Path::new("/tmp")
    };
    parent.join(format!("pcc-{}", getuid().as_raw()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn options(prefix: &str, root: &Path) -> IpcOptions {
        IpcOptions {
            prefix: prefix.to_owned(),
            root: root.to_owned(),
        }
    }

    #[test]
    fn prefixes_that_are_no_file_names_are_refused() {
        let directory = tempfile::tempdir().unwrap();
        for prefix in ["", "a/b", "..", "ä", "a b", &"x".repeat(33)] {
            let error = options(prefix, directory.path()).prepare().unwrap_err();
            assert!(
                matches!(error, IpcError::InvalidPrefix { .. }),
                "{prefix}: {error}"
            );
        }
        options("pcc-2_A", directory.path()).prepare().unwrap();
    }

    #[test]
    fn the_root_is_made_for_this_user_alone() {
        let directory = tempfile::tempdir().unwrap();
        let root = directory.path().join("deep/root");
        options("pcc", &root).prepare().unwrap();
        assert_eq!(fs::metadata(&root).unwrap().mode() & 0o777, 0o700);
    }

    #[test]
    fn a_root_that_is_a_file_is_an_error_that_names_it() {
        let directory = tempfile::tempdir().unwrap();
        let root = directory.path().join("file");
        fs::write(&root, "").unwrap();
        let error = options("pcc", &root).prepare().unwrap_err();
        assert!(
            error.to_string().contains(root.to_str().unwrap()),
            "{error}"
        );
    }
}
