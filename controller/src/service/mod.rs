//! The controller's process: three threads, each with one duty, and the rings between them.
//!
//! * the loop moves the robot, and depends on nothing that could hold it up;
//! * the guard stops the robot: commands, the loss of the daemon, the end of the process;
//! * the relay does everything else: trajectories, state, the log.

mod commands;
mod config;
mod explain;
mod guard;
mod hard_loop;
mod link;
mod ports;
mod relay;
mod results;
mod view;
mod wire;

pub use config::ControllerConfig;
pub use guard::Signals;

use std::{
    io,
    sync::{Arc, atomic::Ordering},
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use shared_types::ipc::{IpcError, IpcOptions, Role, RoleLock, spawn_with_ports};
use tracing::{info, warn};

use guard::{Guard, GuardSettings};
use hard_loop::LoopThread;
use link::Shared;
use relay::Relay;

/// Longest wait for the other threads to end once the robot is at rest: one that is held up ends with the process.
const JOIN_TIMEOUT: Duration = Duration::from_millis(500);
/// Interval at which the threads' end is looked for.
const POLL_INTERVAL: Duration = Duration::from_millis(2);

/// Runs the controller until it is told to shut down; it then stops the robot along its path before it returns.
///
/// A thread that is held up does not keep the process from ending: it is left behind when this returns.
///
/// # Errors
/// [`IpcError::AlreadyRunning`] where another controller lives under the same prefix and root, or what a service or a
/// port failed with.
pub fn run(
    config: ControllerConfig,
    options: &IpcOptions,
    signals: Signals,
) -> Result<(), IpcError> {
    let _role = RoleLock::acquire(options, Role::Controller)?;
    let (loop_end, guard_end, relay_end) = link::link();
    let shared = Arc::clone(&loop_end.shared);
    let guard = GuardSettings {
        daemon_lost_ns: config.daemon_lost_ns,
        realtime_priority: config.realtime_priority.map(guard_priority),
        signals,
    };
    let config = Arc::new(config);
    let (relay_config, relay_options) = (Arc::clone(&config), options.clone());
    let (guard_options, loop_options) = (options.clone(), options.clone());
    let open_relay = move || Relay::open(relay_config, &relay_options, relay_end);
    let open_guard = move || Guard::open(guard, &guard_options, guard_end);
    let open_loop = move || LoopThread::open(config, &loop_options, loop_end);
    let mut threads = Vec::new();
    let started = (|| {
        threads.push(start("relay", open_relay, Relay::serve)?);
        threads.push(start("guard", open_guard, Guard::serve)?);
        threads.push(start("hard-loop", open_loop, LoopThread::run)?);
        robot_driver::claim_shared_memory(options)
    })();
    if started.is_err() {
        shared.quit.store(true, Ordering::Relaxed);
    }
    wait_for_end(&threads, &shared);
    if shared.is_abandoned.load(Ordering::Relaxed) {
        return Err(IpcError::Failed {
            service: "controller".to_owned(),
            what: "hard-loop",
            reason: "it has made no cycle for 5 s; the robot, which was moving, is let go of and ramps to rest".to_owned(),
        });
    }
    if started.is_ok() {
        info!("ended");
    }
    started
}

/// Priority of the guard: one below the loop's, above everything else.
fn guard_priority(priority: u8) -> u8 {
    priority.saturating_sub(1).max(1)
}

/// Waits until all threads are to end, and then at most [`JOIN_TIMEOUT`] until they have ended.
fn wait_for_end(threads: &[JoinHandle<()>], shared: &Shared) {
    while !shared.is_quitting() {
        thread::sleep(POLL_INTERVAL);
    }
    let begin = Instant::now();
    while let Some(held) = threads.iter().find(|thread| !thread.is_finished()) {
        if begin.elapsed() > JOIN_TIMEOUT {
            let name = held.thread().name().unwrap_or_default();
            warn!("the thread {name} is held up and ends with the process");
            return;
        }
        thread::sleep(POLL_INTERVAL);
    }
}

/// Starts a thread that opens what it works with (ports stay in their thread), and returns once that is open.
fn start<T: 'static>(
    name: &'static str,
    open: impl FnOnce() -> Result<T, IpcError> + Send + 'static,
    work: impl FnOnce(T) + Send + 'static,
) -> Result<JoinHandle<()>, IpcError> {
    let failed = |error: io::Error| IpcError::Failed {
        service: "controller".to_owned(),
        what: name,
        reason: error.to_string(),
    };
    spawn_with_ports(name, open, work).map_err(failed)?
}
