//! Removes shared memory whose maker was killed before it had a size, or before it could remove its node counter.
//!
//! iceoryx2 0.10.0 waits for such memory without end, whatever its time limits say: the case `MappingSizeIsZero` of
//! `open_impl` in `iceoryx2-cal/src/dynamic_storage/posix_shared_memory.rs` is the only one without a limit. Opening a
//! service, connecting two ports, and cleaning up after the dead all go through there. Once the name is gone, they go on.

use std::collections::HashMap;
use std::ffi::OsString;
use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::Path;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use rustix::process::geteuid;

use super::IpcOptions;
use super::node_counter::is_of_one_node;
use super::own_memory::FOLDER;

/// Time between two looks.
const PERIOD: Duration = Duration::from_millis(200);
/// Memory without a size, or a node counter, older than this has no living maker: these take microseconds.
const PATIENCE: Duration = Duration::from_secs(1);

/// Looks for abandoned memory of one prefix, in a thread of its own, until dropped.
#[derive(Debug)]
pub(super) struct Sweeper {
    stop: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Sweeper {
    /// Starts the thread.
    ///
    /// # Errors
    /// What the system says where there can be no more threads.
    pub(super) fn start(options: &IpcOptions) -> std::io::Result<Self> {
        let prefix = options.file_prefix();
        let (stop, stopped) = channel();
        let thread = thread::Builder::new().name("ipc-sweeper".into());
        let thread = thread.spawn(move || {
            let mut seen = HashMap::new();
            while stopped.recv_timeout(PERIOD) == Err(RecvTimeoutError::Timeout) {
                sweep(&prefix, &mut seen);
            }
        })?;
        Ok(Self {
            stop: Some(stop),
            thread: Some(thread),
        })
    }
}

impl Drop for Sweeper {
    fn drop(&mut self) {
        self.stop = None;
        if let Some(thread) = self.thread.take() {
            // A sweeper that panicked has nothing to hand over.
            let _ = thread.join();
        }
    }
}

/// Removes what has been half-made for too long; `seen` says since when.
fn sweep(prefix: &str, seen: &mut HashMap<OsString, Instant>) {
    let (now, half_made) = (Instant::now(), half_made(prefix));
    seen.retain(|name, _| half_made.contains(name));
    for name in half_made {
        let since = *seen.entry(name.clone()).or_insert(now);
        if now - since >= PATIENCE {
            // Another process may have been faster.
            let _ = fs::remove_file(Path::new(FOLDER).join(name));
        }
    }
}

fn half_made(prefix: &str) -> Vec<OsString> {
    let user = geteuid().as_raw();
    let is_half_made = |entry: &fs::DirEntry| {
        let name = entry.file_name();
        let Some(name) = name.to_str().filter(|name| name.starts_with(prefix)) else {
            return false;
        };
        entry.metadata().is_ok_and(|data| {
            let own_file = data.is_file() && data.uid() == user;
            own_file && (data.len() == 0 || is_of_one_node(prefix, name))
        })
    };
    let entries = fs::read_dir(FOLDER).into_iter().flatten().flatten();
    let names = entries.filter(is_half_made).map(|entry| entry.file_name());
    names.collect()
}
