//! Errors of services, ports and roles.

use std::io;
use std::path::PathBuf;

use iceoryx2::node::NodeCreationFailure;

/// Why a service, a port or a role is not available.
#[derive(Debug, thiserror::Error)]
pub enum IpcError {
    /// The prefix cannot be part of a file name.
    #[error(
        "prefix {prefix:?} is not usable: 1 to 32 of a-z, A-Z, 0-9, '_' and '-' are allowed (PCC_PREFIX)"
    )]
    InvalidPrefix {
        /// The prefix found.
        prefix: String,
    },
    /// The root directory cannot be used.
    #[error("cannot use {path:?} as the directory for service files (PCC_ROOT): {source}")]
    Root {
        /// The directory.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The root directory belongs to someone else.
    #[error(
        "{path:?} belongs to user {owner}, this process runs as {user}: all processes of one robot run as one user \
         (or set PCC_ROOT)"
    )]
    ForeignRoot {
        /// The directory.
        path: PathBuf,
        /// The directory's owner.
        owner: u32,
        /// This process's user.
        user: u32,
    },
    /// The root directory's mode is not 0700: other users could get in.
    #[error(
        "{path:?} (user {owner}) has mode {mode:04o}: only 0700 is allowed for the directory of service files (PCC_ROOT), \
         for whoever can open its lock files can block every process; name another, which is made so, or close this one \
         while none of them runs"
    )]
    OpenRoot {
        /// The directory.
        path: PathBuf,
        /// The directory's permission bits.
        mode: u32,
        /// The directory's owner.
        owner: u32,
    },
    /// Somebody else can put another directory in the root directory's place.
    #[error(
        "{path:?} lies in {parent:?} (user {owner}, mode {mode:04o}), where others can replace it: the directory for \
         service files (PCC_ROOT) may only lie in directories of this user's or of root's that nobody else can write to, \
         or that are sticky"
    )]
    ReplaceableRoot {
        /// The directory.
        path: PathBuf,
        /// The directory that it lies in, at whatever depth.
        parent: PathBuf,
        /// The outer directory's permission bits.
        mode: u32,
        /// The outer directory's owner.
        owner: u32,
    },
    /// Shared memory cannot be made.
    #[error("cannot make shared memory in {folder:?}: {source}")]
    SharedMemory {
        /// The directory of all shared memory.
        folder: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The node could not be created.
    #[error("cannot join the services under {root:?}: {reason:?}")]
    Node {
        /// The root directory.
        root: PathBuf,
        /// What iceoryx2 said.
        reason: NodeCreationFailure,
    },
    /// The thread that removes what killed processes left half-made did not start.
    #[error("cannot start the thread that removes what killed processes left half-made: {source}")]
    Sweeper {
        /// What the system said.
        source: io::Error,
    },
    /// Another live process has the role.
    #[error(
        "a {role} already runs here (process {pid}); stop it first, or use another PCC_PREFIX (lock {lock_file:?})"
    )]
    AlreadyRunning {
        /// The role's name.
        role: &'static str,
        /// Process id that the holder wrote, empty if it has not yet.
        pid: String,
        /// The lock file that the other process holds.
        lock_file: PathBuf,
    },
    /// Another process is opening services and does not come to an end.
    #[error(
        "another process holds {lock_file:?} for longer than opening services takes; is one of them stopped?"
    )]
    Busy {
        /// The lock file that the other process holds.
        lock_file: PathBuf,
    },
    /// A lock file cannot be used.
    #[error("cannot lock {lock_file:?}: {source}")]
    Lock {
        /// The lock file.
        lock_file: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The services cannot be listed.
    #[error("cannot list the services under {root:?}: {reason}")]
    Unlisted {
        /// The root directory.
        root: PathBuf,
        /// What iceoryx2 said.
        reason: String,
    },
    /// The service does not exist: the process that creates it has not started.
    #[error(
        "service {service} does not exist: {creator} is not running under this prefix and root"
    )]
    Missing {
        /// The service's name.
        service: String,
        /// The process that creates the service.
        creator: &'static str,
    },
    /// The service exists with other messages or qualities.
    #[error(
        "service {service} exists with other {} ({reason}): stop all its users and start them again from one build and one configuration",
        what_differs(.expected, .found)
    )]
    Incompatible {
        /// The service's name.
        service: String,
        /// The protocol's version and the types, with their sizes and alignments in bytes, that this program has.
        expected: String,
        /// Those of the service that is there.
        found: String,
        /// What iceoryx2 said.
        reason: String,
    },
    /// The service was made by another version of iceoryx2.
    #[error(
        "service {service} was made by another iceoryx2 version, or is damaged ({reason}): every program, also Python's, \
         needs iceoryx2 0.10.0"
    )]
    OtherLibraryVersion {
        /// The service's name.
        service: String,
        /// What iceoryx2 said.
        reason: String,
    },
    /// All places of a service are taken by live processes.
    #[error("service {service} has no free place for another {port}{}", who_may_close(.users))]
    Full {
        /// The service's name.
        service: String,
        /// The kind of port.
        port: &'static str,
        /// The programs that have the service open, with their processes; empty where none is known.
        users: Vec<String>,
    },
    /// A service cannot be opened for another reason.
    #[error("cannot open service {service} ({what}): {reason}")]
    Failed {
        /// The service's name.
        service: String,
        /// What cannot be opened: the service as a whole, its name, or a kind of port.
        what: &'static str,
        /// What iceoryx2 said.
        reason: String,
    },
}

/// In what a service that is there is another one.
fn what_differs(expected: &str, found: &str) -> String {
    match expected == found {
        true => format!("capacities, the types being the same, {found}"),
        false => format!("types: expected {expected}; found {found}"),
    }
}

/// The end of the message that a service is full.
fn who_may_close(users: &[String]) -> String {
    match users {
        [] => String::new(),
        users => format!(
            "; close one of those that have it open: {}",
            users.join(", ")
        ),
    }
}
