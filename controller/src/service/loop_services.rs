//! The threads beside a loop: guard and relay, which serve everybody else, and one that cleans up after dead processes.

use std::{
    io,
    sync::{Arc, atomic::Ordering},
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use realtime::use_idle_policy;
use shared_types::ipc::{IpcError, IpcNode, IpcOptions, Role, RoleLock, spawn_with_ports};
use tracing::{info, warn};

use super::{
    config::ControllerConfig,
    guard::{Guard, GuardSettings, Signals},
    link::{self, LoopEnd, Shared},
    relay::Relay,
};

/// Longest wait for the threads to end once the robot is at rest: one that is held up ends with the process.
const JOIN_TIMEOUT: Duration = Duration::from_millis(500);
/// Interval at which the threads' end is looked for.
const POLL_INTERVAL: Duration = Duration::from_millis(2);

/// The controller's place, and the threads that serve it; they end when this is dropped.
pub(super) struct LoopServices {
    threads: Vec<JoinHandle<()>>,
    shared: Arc<Shared>,
    // Declared last: the place is free when nobody serves it any more.
    _role: RoleLock,
}

impl LoopServices {
    /// Takes the controller's place, and starts the threads beside the loop; the other end is for the loop.
    ///
    /// # Errors
    /// [`IpcError::AlreadyRunning`] where another controller lives under the same prefix and root, or what a service or a port failed
    /// with.
    pub(super) fn start(
        config: &Arc<ControllerConfig>,
        options: &IpcOptions,
        signals: Signals,
    ) -> Result<(Self, LoopEnd), IpcError> {
        let role = RoleLock::acquire(options, Role::Controller)?;
        let (loop_end, guard_end, relay_end) = link::link();
        let mut services = Self {
            threads: Vec::new(),
            shared: Arc::clone(&loop_end.shared),
            _role: role,
        };
        let settings = GuardSettings {
            daemon_lost_ns: config.daemon_lost_ns,
            realtime_priority: config.realtime_priority.map(guard_priority),
            signals,
        };
        let (relay_config, relay_options) = (Arc::clone(config), options.clone());
        let open_relay = move || Relay::open(relay_config, &relay_options, relay_end);
        let guard_options = options.clone();
        let open_guard = move || Guard::open(settings, &guard_options, guard_end);
        services.add("relay", open_relay, Relay::serve)?;
        services.add("guard", open_guard, Guard::serve)?;
        let (shared, cleaning_options) = (Arc::clone(&services.shared), options.clone());
        let open_node = move || IpcNode::create(&cleaning_options, "controller-cleaning");
        services.add("cleaning", open_node, move |node| clean(&node, &shared))?;
        Ok((services, loop_end))
    }

    /// Starts another thread that opens what it works with (ports stay in their thread), and returns once that is open.
    ///
    /// # Errors
    /// What it cannot open, or that there can be no more threads.
    pub(super) fn add<T: 'static>(
        &mut self,
        name: &'static str,
        open: impl FnOnce() -> Result<T, IpcError> + Send + 'static,
        work: impl FnOnce(T) + Send + 'static,
    ) -> Result<(), IpcError> {
        let failed = |error: io::Error| IpcError::Failed {
            service: "controller".to_owned(),
            what: name,
            reason: error.to_string(),
        };
        let thread = spawn_with_ports(name, open, work).map_err(failed)??;
        self.threads.push(thread);
        Ok(())
    }

    /// What all threads share.
    pub(super) fn shared(&self) -> &Shared {
        &self.shared
    }

    /// Waits until all threads are to end.
    pub(super) fn wait_until_quitting(&self) {
        while !self.shared.is_quitting() {
            thread::sleep(POLL_INTERVAL);
        }
    }
}

impl Drop for LoopServices {
    /// Has the threads end, and waits at most [`JOIN_TIMEOUT`] until they have.
    fn drop(&mut self) {
        self.shared.quit.store(true, Ordering::Relaxed);
        for thread in &self.threads {
            thread.thread().unpark();
        }
        let begin = Instant::now();
        while let Some(held) = self.threads.iter().find(|thread| !thread.is_finished()) {
            if begin.elapsed() > JOIN_TIMEOUT {
                let name = held.thread().name().unwrap_or_default();
                warn!("the thread {name} is held up and ends with the process");
                return;
            }
            thread::sleep(POLL_INTERVAL);
        }
    }
}

/// Removes what dead processes leave, while nobody else wants the processor.
fn clean(node: &IpcNode, shared: &Shared) {
    if let Err(error) = use_idle_policy() {
        warn!("what has arrived may be heard some milliseconds late now and then: {error}");
    }
    node.keep_clean(
        || shared.is_quitting(),
        |removed| info!("cleaned up after {removed} dead nodes"),
    );
}

/// Priority of the guard: one below the loop's, above everything else.
fn guard_priority(priority: u8) -> u8 {
    priority.saturating_sub(1).max(1)
}
