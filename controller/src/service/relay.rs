//! The relay thread: serves those who come and go, so that the loop's own peers stay fixed.
//!
//! It copies and checks trajectories, publishes state and cycles, writes the log, and cleans up after dead processes. All of
//! that may be held up, and nothing that stops the robot waits for it: that is the guard's. While the relay stands still no
//! trajectory is taken, and no state goes out, so that the daemon, which then knows nothing of the motion, orders a stop.

use std::{
    sync::{Arc, atomic::Ordering},
    thread,
    time::Duration,
};

use shared_types::{
    clock::mono_now_ns,
    codes::LoopState,
    ipc::{CYCLES_PER_BATCH, IpcError, IpcOptions},
    message::{Cycle, TrajectoryMessage},
};
use tracing::{debug, info, warn};

use super::{
    config::ControllerConfig,
    link::{GuardEvent, RelayEnd, Return},
    ports::Ports,
    view::View,
    wire,
};
use crate::executive::{Motion, Unacceptable, check};

const TICK: Duration = Duration::from_millis(2);
const BATCH_EVERY_NS: i64 = 10_000_000;
const STATE_EVERY_NS: i64 = 20_000_000;
const TIDY_EVERY_NS: i64 = 100_000_000;

/// A trajectory that arrives so soon after the relay's start was meant for a controller before this one.
const INHERITANCE: Duration = Duration::from_millis(100);

/// Trajectories in the process: one executing, one waiting or on its way, one being checked.
const MOTIONS: usize = 3;

/// What is due again at fixed times.
struct Due {
    every_ns: i64,
    next_ns: i64,
}

impl Due {
    fn every(every_ns: i64) -> Self {
        Self {
            every_ns,
            next_ns: 0,
        }
    }

    fn is_due(&mut self, now_ns: i64) -> bool {
        if now_ns < self.next_ns {
            return false;
        }
        self.next_ns = now_ns + self.every_ns;
        true
    }
}

/// The relay thread's state.
pub(super) struct Relay {
    config: Arc<ControllerConfig>,
    ports: Ports,
    link: RelayEnd,
    view: View,
    spare: Vec<Motion>,
    incoming: Box<TrajectoryMessage>,
    batch: Vec<Cycle>,
    last_taken: Option<(u32, i64)>,
    /// When the last trajectory was handed to the loop, ns of CLOCK_MONOTONIC.
    handed_over_ns: i64,
}

impl Relay {
    /// Opens the ports, and lets pass what was meant for a controller before this one: a restarted controller never
    /// resumes a motion by itself.
    ///
    /// # Errors
    /// [`IpcError`] where a service or port cannot be opened.
    pub(super) fn open(
        config: Arc<ControllerConfig>,
        options: &IpcOptions,
        link: RelayEnd,
    ) -> Result<Self, IpcError> {
        let mut relay = Self {
            view: View::new(config.executive.period_ns),
            config,
            ports: Ports::open(options)?,
            link,
            spare: (0..MOTIONS).map(|_| Motion::empty()).collect(),
            incoming: Box::new(TrajectoryMessage::ZEROED),
            batch: Vec::with_capacity(CYCLES_PER_BATCH),
            last_taken: None,
            handed_over_ns: i64::MIN,
        };
        relay.ports.tidy();
        thread::sleep(INHERITANCE);
        while relay.ports.next_trajectory(&mut relay.incoming) {
            debug!(
                id = relay.incoming.trajectory_id,
                "trajectory of an earlier time passed over"
            );
        }
        Ok(relay)
    }

    /// Serves until all threads are to end.
    pub(super) fn serve(mut self) {
        // The loop says what the system refuses.
        let _ = realtime::reduce_wakeup_latency();
        let (mut batch, mut state) = (Due::every(BATCH_EVERY_NS), Due::every(STATE_EVERY_NS));
        let (mut beat, mut tidy) = (Due::every(STATE_EVERY_NS), Due::every(TIDY_EVERY_NS));
        while !self.link.shared.is_quitting() {
            let now_ns = mono_now_ns();
            self.take_reports();
            self.take_returns();
            self.take_events();
            self.take_trajectories();
            if batch.is_due(now_ns) {
                self.send_batch();
            }
            if self.knows_of_last_trajectory() && state.is_due(now_ns) {
                self.send_state();
            }
            if beat.is_due(now_ns) {
                self.ports.send_heartbeat(self.view.instance());
            }
            if tidy.is_due(now_ns) {
                self.ports.tidy();
            }
            thread::sleep(TICK);
        }
        self.take_reports();
        self.take_events();
        self.send_batch();
        if self.knows_of_last_trajectory() {
            self.send_state();
        }
    }

    /// Whether the newest cycle known has met the trajectory that was handed over last. A state of a cycle before it would say
    /// of a trajectory, once its begin is past, that it was not taken up.
    fn knows_of_last_trajectory(&self) -> bool {
        self.handed_over_ns == i64::MIN || self.view.is_later_than(self.handed_over_ns)
    }

    fn send_state(&mut self) {
        let message = self.view.message(&self.link.shared);
        self.ports.send_state(&message);
    }

    fn take_reports(&mut self) {
        while let Ok(report) = self.link.reports.pop() {
            self.batch.push(wire::cycle(&report));
            self.view.observe(report);
            if self.batch.len() == CYCLES_PER_BATCH {
                self.send_batch();
            }
        }
        let lost = self.link.shared.reports_lost.swap(0, Ordering::Relaxed);
        if lost > 0 {
            warn!(
                lost,
                "cycles that nobody will know of: the relay thread did not get to run"
            );
        }
    }

    fn send_batch(&mut self) {
        if !self.batch.is_empty() {
            self.ports.send_cycles(&self.batch);
            self.batch.clear();
        }
    }

    fn take_returns(&mut self) {
        while let Ok(returned) = self.link.returns.pop() {
            match returned {
                Return::Finished(motion) => {
                    if !self.view.has_executed(motion.id) {
                        self.refuse(motion.id, &Unacceptable::SetAside);
                    }
                    self.spare.push(motion);
                }
                Return::Refused(reason, motion) => {
                    self.refuse(motion.id, &reason);
                    self.spare.push(motion);
                }
            }
        }
    }

    fn take_events(&mut self) {
        while let Ok(event) = self.link.events.pop() {
            log(event);
        }
        let lost = self.link.shared.events_lost.swap(0, Ordering::Relaxed);
        if lost > 0 {
            warn!(lost, "commands and events that are not in this log");
        }
    }

    fn take_trajectories(&mut self) {
        while self.ports.next_trajectory(&mut self.incoming) {
            let id = self.incoming.trajectory_id;
            let Some(mut motion) = self.spare.pop() else {
                self.refuse(id, &Unacceptable::Waiting);
                continue;
            };
            match self.accept(&mut motion) {
                Ok(()) => self.execute(motion),
                Err(reason) => {
                    self.refuse(id, &reason);
                    self.spare.push(motion);
                }
            }
        }
    }

    /// Checks the private copy completely.
    fn accept(&self, motion: &mut Motion) -> Result<(), Unacceptable> {
        wire::fill(motion, &self.incoming)?;
        if self.incoming.controller_instance != self.view.instance() {
            return Err(Unacceptable::OtherController);
        }
        if !self.link.shared.daemon_alive.load(Ordering::Relaxed) {
            return Err(Unacceptable::DaemonSilent);
        }
        let situation = self
            .view
            .situation(self.link.shared.heard(), self.last_taken)
            .ok_or(Unacceptable::State(LoopState::Starting))?;
        check(motion, &situation, &self.config.robot, &self.config.begin)
    }

    fn execute(&mut self, motion: Motion) {
        let (id, begin_ns) = (motion.id, motion.begin_ns);
        info!(
            id,
            knots = motion.knots.len(),
            duration_s = motion.duration_s(),
            "trajectory accepted"
        );
        match self.link.motions.push(motion) {
            Ok(()) => {
                self.last_taken = Some((id, begin_ns));
                self.handed_over_ns = mono_now_ns();
            }
            Err(rtrb::PushError::Full(motion)) => {
                self.refuse(id, &Unacceptable::Waiting);
                self.spare.push(motion);
            }
        }
    }

    fn refuse(&mut self, id: u32, reason: &Unacceptable) {
        warn!(id, %reason, "trajectory refused");
        self.view.refused(id, reason.code());
    }
}

fn log(event: GuardEvent) {
    match event {
        GuardEvent::Commanded(command, outcome) => {
            let (result, state) = (outcome.result, outcome.state);
            info!(?command, ?result, %state, "command");
        }
        GuardEvent::DaemonLost(state) => {
            warn!(%state, "the daemon's heart has stopped: a motion is stopped along its path");
        }
        GuardEvent::DaemonFound => info!("the daemon's heart beats"),
        GuardEvent::DaemonReplaced => {
            warn!(
                "another daemon is there: the motion of the one before is stopped along its path"
            );
        }
        GuardEvent::Signalled => info!("a signal orders a stop"),
        GuardEvent::Suspended => warn!("the machine was suspended: stopping along the path"),
        GuardEvent::ShuttingDown(LoopState::Executing | LoopState::Stopping) => {
            info!("shutting down: stopping the robot along its path");
        }
        GuardEvent::ShuttingDown(_) => info!("shutting down"),
        GuardEvent::PriorityRefused(priority) => {
            warn!(
                "no real-time priority {priority} for the guard: other programs can delay a stop"
            );
        }
    }
}
