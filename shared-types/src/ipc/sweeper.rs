//! Removes shared memory whose maker was killed before it had a size.
//!
//! iceoryx2 0.10.0 waits for such memory without end, whatever its time limits say: the case `MappingSizeIsZero` of
//! `open_impl` in `iceoryx2-cal/src/dynamic_storage/posix_shared_memory.rs` is the only one without a limit. Opening a
//! service, connecting two ports, and cleaning up after the dead all go through there. Once the name is gone, they go on.

use std::collections::HashMap;
use std::ffi::OsString;
use std::fs;
use std::path::Path;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use super::IpcOptions;

/// Where POSIX shared memory has its names.
const SHARED_MEMORY: &str = "/dev/shm";
/// Time between two looks.
const PERIOD: Duration = Duration::from_millis(200);
/// Memory without a size for longer than this has no living maker: making it takes microseconds.
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
        let prefix = format!("{}_", options.prefix);
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

/// Removes what has been without a size for too long; `seen` says since when.
fn sweep(prefix: &str, seen: &mut HashMap<OsString, Instant>) {
    let (now, empty) = (Instant::now(), without_size(prefix));
    seen.retain(|name, _| empty.contains(name));
    for name in empty {
        let since = *seen.entry(name.clone()).or_insert(now);
        if now - since >= PATIENCE {
            // Another process may have been faster.
            let _ = fs::remove_file(Path::new(SHARED_MEMORY).join(name));
        }
    }
}

fn without_size(prefix: &str) -> Vec<OsString> {
    let entries = fs::read_dir(SHARED_MEMORY).into_iter().flatten().flatten();
    let ours = entries.filter(|entry| {
        entry
            .file_name()
            .as_encoded_bytes()
            .starts_with(prefix.as_bytes())
    });
    let empty = |entry: &fs::DirEntry| entry.metadata().is_ok_and(|m| m.is_file() && m.len() == 0);
    ours.filter(empty).map(|entry| entry.file_name()).collect()
}
