//! Removes shared memory whose maker was killed before it had a size, or before it could remove its node counter, and nodes that were killed
//! while they were made ([`super::half_made_node`]), and what listeners leave ([`super::left_listener`]).
//!
//! Programs that have only iceoryx2 0.10.0 wait for such memory without end, whatever its time limits say: the case
//! `MappingSizeIsZero` of `open_impl` in `iceoryx2-cal/src/dynamic_storage/posix_shared_memory.rs` is the only one without a limit.
//! Opening a service, connecting two ports, and cleaning up after the dead all go through there. For this project's processes
//! it is memory that may not be read yet ([`super::shm_override`]), which iceoryx2 waits for up to its creation timeout; but it
//! stays until its name is gone.
//!
//! A maker that was only stopped keeps what it makes: it has it open ([`super::write_lease`]).

use std::collections::HashMap;
use std::ffi::OsStr;
use std::fs::{self, Metadata, OpenOptions};
use std::io::{self, ErrorKind};
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::thread;
use std::time::{Duration, Instant};

use rustix::fs::OFlags;
use rustix::process::geteuid;

use super::half_made_node::{half_made_nodes, remove_half_made_node};
use super::left_listener::left_by_listeners;
use super::node_counter::is_of_one_node;
use super::shm_override::FOLDER;
use super::write_lease::WriteLease;
use super::{IpcOptions, JoinOnDrop};

/// Time between two looks.
const PERIOD: Duration = Duration::from_millis(200);
/// What is half-made for longer than this is looked at closely: it takes microseconds to make.
const PATIENCE: Duration = Duration::from_millis(500);

/// Looks for abandoned memory of one prefix, in a thread of its own, until dropped.
#[derive(Debug)]
pub(super) struct Sweeper {
    /// The thread ends once this is dropped: declared before the thread, which is joined when it is dropped, because fields are dropped
    /// in the order of their declaration.
    _stop: Sender<()>,
    _thread: JoinOnDrop,
}

/// Sweepers of this process that run, by process, because a fork has none of its threads, and options.
static RUNNING: Mutex<Vec<(u32, IpcOptions, Weak<Sweeper>)>> = Mutex::new(Vec::new());

impl Sweeper {
    /// The one of this process with these options, which is started where none runs.
    ///
    /// # Errors
    /// What the system says where there can be no more threads.
    pub(super) fn of_process(options: &IpcOptions) -> io::Result<Arc<Self>> {
        let process = std::process::id();
        let mut running = RUNNING.lock().unwrap_or_else(PoisonError::into_inner);
        running.retain(|(_, _, sweeper)| sweeper.strong_count() > 0);
        let mut known = running.iter();
        let known = known.find(|(of, with, _)| *of == process && with == options);
        if let Some(sweeper) = known.and_then(|(_, _, sweeper)| sweeper.upgrade()) {
            return Ok(sweeper);
        }
        let sweeper = Arc::new(Self::start(options)?);
        running.push((process, options.clone(), Arc::downgrade(&sweeper)));
        Ok(sweeper)
    }

    fn start(options: &IpcOptions) -> io::Result<Self> {
        let options = options.clone();
        let (stop, stopped) = channel();
        let thread = thread::Builder::new().name("ipc-sweeper".into());
        let thread = thread.spawn(move || {
            let mut seen = HashMap::new();
            while stopped.recv_timeout(PERIOD) == Err(RecvTimeoutError::Timeout) {
                sweep(&options, &mut seen);
            }
        })?;
        Ok(Self {
            _stop: stop,
            _thread: thread.into(),
        })
    }
}

/// Removes what has been half-made for too long; `seen` says since when.
fn sweep(options: &IpcOptions, seen: &mut HashMap<PathBuf, Instant>) {
    let prefix = options.file_prefix();
    let (memory, nodes) = (half_made(&prefix), half_made_nodes(&options.root));
    let of_listeners = left_by_listeners(&prefix, &options.root, Path::new(FOLDER));
    seen.retain(|path, _| {
        memory.contains(path) || nodes.contains(path) || of_listeners.contains(path)
    });
    let now = Instant::now();
    let mut is_due =
        |path: &&PathBuf| now - *seen.entry((*path).clone()).or_insert(now) >= PATIENCE;
    // The maker of what is left may live, and another process may have been faster.
    for path in memory.iter().filter(&mut is_due) {
        let _ = remove_abandoned(&prefix, path);
    }
    for path in nodes.iter().filter(&mut is_due) {
        let _ = remove_half_made_node(path);
    }
    for path in of_listeners.iter().filter(&mut is_due) {
        let _ = fs::remove_file(path);
    }
}

/// Removes what is still half-made, unless its maker lives.
///
/// # Errors
/// What the system says; [`io::ErrorKind::WouldBlock`] where somebody has it open.
fn remove_abandoned(prefix: &str, path: &Path) -> io::Result<()> {
    let flags = OFlags::NOFOLLOW | OFlags::NONBLOCK;
    let mut options = OpenOptions::new();
    let options = options.write(true).custom_flags(flags.bits().cast_signed());
    let file = options.open(path)?;
    let _lease = match WriteLease::of(&file) {
        Err(error) if error.kind() == ErrorKind::WouldBlock && !is_connection(path) => {
            return Err(error);
        }
        // Where the system has no leases, age alone decides.
        lease => lease.ok(),
    };
    // Since it was listed it may have been finished, or made anew.
    let (data, named) = (file.metadata()?, fs::symlink_metadata(path)?);
    let is_the_same = (data.dev(), data.ino()) == (named.dev(), named.ino());
    let name = path.file_name().unwrap_or_default();
    if is_the_same && is_half_made(prefix, name, &named) {
        fs::remove_file(path)?;
    }
    Ok(())
}

/// A connection of two ports has two makers, and the one waits for the other: a process that moves a robot must not wait for one that
/// was stopped.
fn is_connection(path: &Path) -> bool {
    path.extension().is_some_and(|end| end == "connection")
}

fn half_made(prefix: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir(FOLDER).into_iter().flatten().flatten();
    let half_made = entries.filter(|entry| {
        // The name is cheaper to look at than the file.
        let is_ours = entry.file_name().as_bytes().starts_with(prefix.as_bytes());
        let data = is_ours.then(|| entry.metadata());
        data.is_some_and(|data| data.is_ok_and(|d| is_half_made(prefix, &entry.file_name(), &d)))
    });
    half_made.map(|entry| entry.path()).collect()
}

fn is_half_made(prefix: &str, name: &OsStr, data: &Metadata) -> bool {
    let own_file = data.is_file() && data.uid() == geteuid().as_raw();
    let is_counter = || {
        name.to_str()
            .is_some_and(|name| is_of_one_node(prefix, name))
    };
    own_file && (data.len() == 0 || is_counter())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nodes_of_one_process_share_a_sweeper_for_as_long_as_one_of_them_has_it() {
        let options = |prefix: &str| IpcOptions {
            prefix: prefix.to_owned(),
            root: "/tmp/unused".into(),
        };
        let first = Sweeper::of_process(&options("one")).unwrap();
        let second = Sweeper::of_process(&options("one")).unwrap();
        let other = Sweeper::of_process(&options("other")).unwrap();
        assert!(Arc::ptr_eq(&first, &second) && !Arc::ptr_eq(&first, &other));
        let ended = Arc::downgrade(&first);
        drop((first, second));
        assert!(ended.upgrade().is_none());
        assert!(Sweeper::of_process(&options("one")).is_ok());
    }

    #[test]
    fn a_half_made_node_of_a_dead_process_is_removed_once_it_is_old() {
        let root = tempfile::tempdir().unwrap();
        let nobody = (u128::from(i32::MAX.unsigned_abs()) << 64).to_string();
        let node = root.path().join("nodes").join(nobody);
        fs::create_dir_all(&node).unwrap();
        let options = IpcOptions {
            prefix: format!("sweeper{}", std::process::id()),
            root: root.path().to_owned(),
        };
        let mut seen = HashMap::new();
        sweep(&options, &mut seen);
        assert!(node.is_dir());
        let since = seen.get_mut(&node).unwrap();
        *since = since.checked_sub(PATIENCE).unwrap();
        sweep(&options, &mut seen);
        assert!(!node.exists());
    }
}
