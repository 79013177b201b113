//! The controller's process: three threads, each with one duty, and the rings between them.
//!
//! * the loop moves the robot, and depends on nothing that could hold it up;
//! * the guard stops the robot: commands, the loss of the daemon, the end of the process;
//! * the relay does everything else: trajectories, state, the log.

mod commands;
mod config;
mod guard;
mod hard_loop;
mod link;
mod ports;
mod relay;
mod view;
mod wire;

pub use config::ControllerConfig;
pub use guard::Signals;

use std::{
    sync::{Arc, atomic::Ordering, mpsc::sync_channel},
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use shared_types::ipc::{IpcError, IpcOptions, Role, RoleLock};
use tracing::{info, warn};

use crate::shared_memory;

use guard::{Guard, GuardSettings};
use hard_loop::LoopThread;
use link::{GuardEnd, LoopEnd, RelayEnd, Shared};
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
    let controller = Controller {
        config: Arc::new(config),
        options: options.clone(),
    };
    let mut threads = Vec::new();
    let started = (|| {
        threads.push(controller.start_relay(relay_end)?);
        threads.push(controller.start_guard(guard, guard_end)?);
        threads.push(controller.start_loop(loop_end)?);
        shared_memory::claim(options)
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

/// Configuration and services of the threads.
struct Controller {
    config: Arc<ControllerConfig>,
    options: IpcOptions,
}

impl Controller {
    fn start_relay(&self, link: RelayEnd) -> Result<JoinHandle<()>, IpcError> {
        let (config, options) = (Arc::clone(&self.config), self.options.clone());
        let open = move || Relay::open(config, &options, link);
        start("relay", open, Relay::serve)
    }

    fn start_guard(
        &self,
        settings: GuardSettings,
        link: GuardEnd,
    ) -> Result<JoinHandle<()>, IpcError> {
        let options = self.options.clone();
        let open = move || Guard::open(settings, &options, link);
        start("guard", open, Guard::serve)
    }

    fn start_loop(&self, link: LoopEnd) -> Result<JoinHandle<()>, IpcError> {
        let (config, options) = (Arc::clone(&self.config), self.options.clone());
        let open = move || LoopThread::open(config, &options, link);
        start("hard-loop", open, LoopThread::run)
    }
}

/// Starts a thread that opens what it works with (ports stay in their thread), and returns once that is open.
fn start<T: 'static>(
    name: &'static str,
    open: impl FnOnce() -> Result<T, IpcError> + Send + 'static,
    work: impl FnOnce(T) + Send + 'static,
) -> Result<JoinHandle<()>, IpcError> {
    let failed = |reason: String| IpcError::Failed {
        service: "controller".to_owned(),
        what: name,
        reason,
    };
    let (report, opened_or_failed) = sync_channel(1);
    let begin = move || {
        let (opened, result) = match open() {
            Ok(opened) => (Some(opened), Ok(())),
            Err(error) => (None, Err(error)),
        };
        // The receiver waits for it.
        let _ = report.send(result);
        if let Some(opened) = opened {
            work(opened);
        }
    };
    let thread = thread::Builder::new().name(name.to_owned()).spawn(begin);
    let thread = thread.map_err(|error| failed(error.to_string()))?;
    opened_or_failed
        .recv()
        .map_err(|error| failed(error.to_string()))??;
    Ok(thread)
}
