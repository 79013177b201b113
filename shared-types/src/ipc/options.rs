//! Where the services live.

use std::env;
use std::fs;
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

use iceoryx2::config::Config;
use iceoryx2::prelude::{FileName, Path as IoxPath, SemanticString};
use rustix::process::geteuid;

use super::node_counter::remove_shared;
use super::{IpcError, root_folder};

/// Longest time for making a service or a port: some milliseconds, and the stalls of a busy machine. A process that waits for one that a
/// stopped process has begun is held for as long: less than half of what the controller's loop allows its guard.
const CREATION_TIMEOUT: Duration = Duration::from_millis(40);

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
    /// `/tmp` where there is no `/dev/shm`; where another user has taken that name, or had, `.pcc-services` in the home
    /// directory. It is created for this user alone (0700) and refused where others have a right to it. An absolute path;
    /// with the prefix it has at most [`LONGEST_ROOT_AND_PREFIX`] bytes.
    pub root: PathBuf,
}

impl IpcOptions {
    /// `PCC_PREFIX` and `PCC_ROOT` of the environment, or the defaults.
    ///
    /// What of the prefix is no text in UTF-8 is replaced by a character that no prefix may have: it is refused by name where
    /// the services are joined.
    #[must_use]
    pub fn from_env() -> Self {
        let prefix = env::var_os("PCC_PREFIX").unwrap_or_else(|| "pcc".into());
        Self {
            prefix: prefix.to_string_lossy().into_owned(),
            root: env::var_os("PCC_ROOT").map_or_else(default_root, PathBuf::from),
        }
    }

    /// Removes the shared memory (16 bytes) that iceoryx2 leaves for this prefix; only once no process uses it any more.
    pub fn remove_node_counter(&self) {
        remove_shared(&self.file_prefix());
    }

    /// The full name of a service.
    #[must_use]
    pub fn service_name(&self, service: &str) -> String {
        format!("{}/{service}", self.prefix)
    }

    /// The lock file of a role, or of another activity of one process at a time.
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
        self.iox_root()?;
        let length = self.root.as_os_str().len() + self.prefix.len();
        if length > LONGEST_ROOT_AND_PREFIX {
            return Err(io(io::Error::other(format!(
                "with the prefix it has {length} bytes, at most {LONGEST_ROOT_AND_PREFIX} are allowed"
            ))));
        }
        root_folder::prepare(&self.root)
    }

    /// The prefix of every file name, as iceoryx2 is configured.
    pub(super) fn file_prefix(&self) -> String {
        format!("{}_", self.prefix)
    }

    /// Writes a probe file into the root directory, to name path and reason where iceoryx2 fails without them.
    ///
    /// # Errors
    /// [`IpcError::Root`].
    pub(super) fn probe_root(&self) -> Result<(), IpcError> {
        let file = self
            .root
            .join(format!("{}.probe-{}", self.prefix, std::process::id()));
        let written = fs::write(&file, [0]);
        // Gone already where it could not be made.
        let _ = fs::remove_file(&file);
        written.map_err(|source| IpcError::Root {
            path: self.root.clone(),
            source,
        })
    }

    /// The root directory as a path of iceoryx2, which refuses some characters.
    fn iox_root(&self) -> Result<IoxPath, IpcError> {
        let text = self.root.to_str();
        let root = text.and_then(|root| IoxPath::new(root.as_bytes()).ok());
        root.ok_or_else(|| IpcError::Root {
            path: self.root.clone(),
            source: io::Error::other(
                "only text in UTF-8 is allowed, without control characters and without < > \" | ? *",
            ),
        })
    }

    /// The iceoryx2 configuration: nothing of a system-wide configuration file has a part in it.
    pub(super) fn config(&self) -> Result<Config, IpcError> {
        let root = self.iox_root()?;
        let prefix =
            FileName::new(self.file_prefix().as_bytes()).map_err(|_| IpcError::InvalidPrefix {
                prefix: self.prefix.clone(),
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
    let user = geteuid().as_raw();
    let usual = parent.join(format!("pcc-{user}"));
    let is_foreign = |path: &Path| fs::symlink_metadata(path).is_ok_and(|data| data.uid() != user);
    let home = env::home_dir().filter(|home| home.is_absolute());
    let Some(own) = home.map(|home| home.join(".pcc-services")) else {
        return usual;
    };
    // Once made it is kept to, so that all processes agree also when the other user's folder is gone.
    if own.is_dir() || is_foreign(&usual) {
        own
    } else {
        usual
    }
}

#[cfg(test)]
mod tests {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;

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
        let root = directory.path().join("root");
        options("pcc-2_A", &root).prepare().unwrap();
    }

    #[test]
    fn a_root_that_no_service_can_have_is_refused_before_it_is_made() {
        let directory = tempfile::tempdir().unwrap();
        for name in [&b"\xff"[..], b"a\nb", b"a*"] {
            let root = directory.path().join(OsStr::from_bytes(name));
            let said = options("pcc", &root).prepare().unwrap_err().to_string();
            assert!(said.contains("PCC_ROOT") && said.contains("only"), "{said}");
            assert!(!root.exists());
        }
    }
}
