//! Processes of which there may be only one.

use std::fs::{self, File, TryLockError};
use std::io::{Read, Write};
use std::os::fd::OwnedFd;
use std::os::unix::fs::MetadataExt;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::process::{Pid, PidfdFlags, pidfd_open};

use super::{IpcError, IpcOptions, root_folder};

/// A kind of process of which one prefix has at most one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Answers plan requests and publishes trajectories.
    PlannerDaemon,
    /// Runs the hard loop.
    Controller,
    /// Is the motor end.
    Robot,
}

impl Role {
    /// The name in messages and of the lock file.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::PlannerDaemon => "planner-daemon",
            Self::Controller => "controller",
            Self::Robot => "robot",
        }
    }
}

/// The right to be the only process of a role, until dropped or until the process ends, killed or not.
///
/// An advisory lock of the kernel (`flock`): it is gone the moment its holder is, kill -9 included, and needs no
/// clean-up. The file stays; only its lock means something.
#[derive(Debug)]
pub struct RoleLock {
    _locked: File,
}

impl RoleLock {
    /// Takes the role.
    ///
    /// # Errors
    /// [`IpcError::AlreadyRunning`] with the holder's process id if another live process has it, [`IpcError::Lock`] if
    /// the file cannot be used, or what is wrong with the options.
    pub fn acquire(options: &IpcOptions, role: Role) -> Result<Self, IpcError> {
        options.prepare()?;
        let (role, lock_file) = (role.name(), options.lock_file(role.name()));
        let io = |source| IpcError::Lock {
            lock_file: lock_file.clone(),
            source,
        };
        let mut file = root_folder::open_lock_file(&lock_file).map_err(io)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::Error(source)) => return Err(io(source)),
            Err(TryLockError::WouldBlock) => {
                let mut pid = String::new();
                // An unreadable pid only makes the message shorter.
                let _ = file.read_to_string(&mut pid);
                return Err(IpcError::AlreadyRunning {
                    role,
                    pid: pid.trim().to_owned(),
                    lock_file,
                });
            }
        }
        file.set_len(0)
            .and_then(|()| writeln!(file, "{}", std::process::id()))
            .map_err(io)?;
        Ok(Self { _locked: file })
    }

    /// Process id of who has the role now: the one that the lock file names, if that process has the file open; none where nobody
    /// has it, or the file cannot be read.
    #[must_use]
    pub fn holder(options: &IpcOptions, role: Role) -> Option<u32> {
        // Only in a folder of ours: in another one, the file could name any process.
        options.prepare().ok()?;
        let lock_file = options.lock_file(role.name());
        let pid: u32 = fs::read_to_string(&lock_file).ok()?.trim().parse().ok()?;
        let locked = fs::metadata(&lock_file).ok()?;
        let is_locked =
            |open: fs::Metadata| (open.dev(), open.ino()) == (locked.dev(), locked.ino());
        let open_files = fs::read_dir(format!("/proc/{pid}/fd")).ok()?.flatten();
        let mut open_files = open_files.filter_map(|file| fs::metadata(file.path()).ok());
        open_files.any(is_locked).then_some(pid)
    }
}

/// A process that had a role when it was looked for.
#[derive(Debug)]
pub struct RoleHolder {
    pid: u32,
    /// Readable once the process has ended.
    process: OwnedFd,
}

impl RoleHolder {
    /// Who has the role now; none where nobody has it, or it cannot be told.
    #[must_use]
    pub fn find(options: &IpcOptions, role: Role) -> Option<Self> {
        let pid = RoleLock::holder(options, role)?;
        let process = pidfd_open(Pid::from_raw(pid.try_into().ok()?)?, PidfdFlags::empty()).ok()?;
        // It may have ended in between, and another have its number.
        let is_it = RoleLock::holder(options, role) == Some(pid);
        is_it.then_some(Self { pid, process })
    }

    /// Whether another one is the same process: of those that live, each has a number of its own.
    #[must_use]
    pub fn is(&self, other: &Self) -> bool {
        self.pid == other.pid && self.lives() && other.lives()
    }

    /// Whether it has not ended, by one call of the system.
    #[must_use]
    pub fn lives(&self) -> bool {
        let mut ended = [PollFd::new(&self.process, PollFlags::IN)];
        let at_once = Timespec::default();
        matches!(poll(&mut ended, Some(&at_once)), Ok(0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_second_holder_is_refused_by_name_and_the_role_is_free_after_the_first() {
        let directory = tempfile::tempdir().unwrap();
        let options = IpcOptions {
            prefix: "test".to_owned(),
            root: directory.path().join("root"),
        };
        let first = RoleLock::acquire(&options, Role::Controller).unwrap();
        let holder = || RoleLock::holder(&options, Role::Controller);
        assert_eq!(holder(), Some(std::process::id()));
        let found = RoleHolder::find(&options, Role::Controller);
        assert!(found.is_some_and(|found| found.lives()));
        let error = RoleLock::acquire(&options, Role::Controller).unwrap_err();
        let text = error.to_string();
        assert!(text.contains("a controller already runs"), "{text}");
        assert!(text.contains(&std::process::id().to_string()), "{text}");
        RoleLock::acquire(&options, Role::PlannerDaemon).unwrap();
        RoleLock::acquire(
            &IpcOptions {
                prefix: "other".to_owned(),
                ..options.clone()
            },
            Role::Controller,
        )
        .unwrap();
        drop(first);
        assert_eq!(holder(), None);
        assert!(RoleHolder::find(&options, Role::Controller).is_none());
        RoleLock::acquire(&options, Role::Controller).unwrap();
    }
}
