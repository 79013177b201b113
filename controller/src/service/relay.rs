//! The relay thread: serves processes that come and go, so that the loop's own peers stay fixed.
//!
//! It copies and checks trajectories, publishes state and cycles, writes the log, and cleans up after dead processes. All of
//! that may be held up, and nothing that stops the robot waits for it: that is the guard's work. While the relay stands still no
//! trajectory is taken, and no state is published, so that the daemon, which then knows nothing of the motion, orders a stop.

use std::{
    sync::{Arc, atomic::Ordering},
    thread,
    time::Duration,
};

use shared_types::{
    clock::mono_now_ns,
    codes::LoopState,
    ipc::{CYCLES_PER_BATCH, IpcError, IpcOptions},
    message::{ControllerState, Cycle, TrajectoryMessage},
    valid::SignedCommand,
};
use tracing::{debug, info, warn};

use super::{
    config::ControllerConfig,
    link::{GuardEvent, RelayEnd, Return},
    ports::Ports,
    results::{Results, Subject},
    view::LoopView,
    wire,
};
use crate::executive::{EndedMotion, Ending, Motion, TrajectoryRefusal, check};

/// Sleep between two rounds of the relay.
const ROUND_INTERVAL: Duration = Duration::from_micros(500);
/// Sleep between two rounds while a motion is executed: the most that a motion which leaves it waits for the relay.
const ROUND_INTERVAL_IN_MOTION: Duration = Duration::from_micros(250);
const BATCH_PERIOD_NS: i64 = 10_000_000;
const STATE_PERIOD_NS: i64 = 20_000_000;
const CONNECTION_PERIOD_NS: i64 = 100_000_000;

/// Time after the relay's start in which trajectories arrive that were meant for a controller before this one.
const STALE_TRAJECTORY_WINDOW: Duration = Duration::from_millis(100);

/// Trajectories taken in one round: as many as the service keeps for the relay. A daemon that floods it keeps neither the state nor the
/// results of motions from being published, and its refusals do not push those results out of their readers' buffers.
const TRAJECTORIES_A_ROUND: usize = 4;

/// Longest wait for the loop thread to give back what it has when the process ends, ns.
const LOOP_END_TIMEOUT_NS: i64 = 200_000_000;

/// Trajectories in the process: one executing, one that it joins or that waits, one on its way, one being checked.
const MOTIONS: usize = 4;

/// A timer that is due again after each period.
struct PeriodicTimer {
    every_ns: i64,
    next_ns: i64,
}

impl PeriodicTimer {
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
    view: LoopView,
    results: Results,
    spare: Vec<Motion>,
    incoming: Box<TrajectoryMessage>,
    batch: Vec<Cycle>,
    /// A copy of the trajectory that was handed to the loop last: what comes again is refused, and what leaves it begins with its knots.
    last_taken: Motion,
    /// A copy of the one that was handed to it before, which goes on where the last one is refused or set aside before its switch.
    taken_before: Motion,
    /// The state that was published last.
    told: ControllerState,
    /// Whether `incoming` waits until the loop has begun the last one.
    is_held: bool,
    /// When the last trajectory was handed to the loop, ns of CLOCK_MONOTONIC.
    handed_over_ns: i64,
}

impl Relay {
    /// Opens the ports, and ignores trajectories that were meant for a controller before this one: a restarted controller never
    /// resumes a motion by itself.
    ///
    /// # Errors
    /// [`IpcError`] where a service or port cannot be opened.
    pub(super) fn open(
        config: Arc<ControllerConfig>,
        options: &IpcOptions,
        link: RelayEnd,
    ) -> Result<Self, IpcError> {
        let view = LoopView::new(config.executive, &config.robot);
        let mut relay = Self {
            results: Results::new(view.instance()),
            view,
            config,
            ports: Ports::open(options)?,
            link,
            spare: (0..MOTIONS).map(|_| Motion::empty()).collect(),
            incoming: Box::new(TrajectoryMessage::ZEROED),
            batch: Vec::with_capacity(CYCLES_PER_BATCH),
            last_taken: Motion::empty(),
            taken_before: Motion::empty(),
            told: ControllerState::ZEROED,
            is_held: false,
            handed_over_ns: i64::MIN,
        };
        relay.ports.update_connections();
        thread::sleep(STALE_TRAJECTORY_WINDOW);
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
        // The loop thread logs what the system refuses.
        let _ = realtime::reduce_wakeup_latency();
        let (mut batch, mut state) = (
            PeriodicTimer::every(BATCH_PERIOD_NS),
            PeriodicTimer::every(STATE_PERIOD_NS),
        );
        let (mut beat, mut connections) = (
            PeriodicTimer::every(STATE_PERIOD_NS),
            PeriodicTimer::every(CONNECTION_PERIOD_NS),
        );
        while !self.link.shared.is_quitting() {
            let now_ns = mono_now_ns();
            self.round();
            if batch.is_due(now_ns) {
                self.send_batch();
            }
            let is_due = state.is_due(now_ns) || self.view.differs_from(&self.told);
            if self.has_seen_last_trajectory() && is_due {
                self.send_state();
            }
            if beat.is_due(now_ns) {
                self.ports.send_heartbeat(self.view.instance());
            }
            if connections.is_due(now_ns) {
                self.ports.update_connections();
            }
            thread::sleep(if self.view.is_executing() {
                ROUND_INTERVAL_IN_MOTION
            } else {
                ROUND_INTERVAL
            });
        }
        self.end();
    }

    /// Takes in what has come from loop, guard and daemon, and tells how motions ended.
    fn round(&mut self) {
        self.take_reports();
        self.take_returns();
        self.take_events();
        self.take_trajectories();
        self.results.send(|result| self.ports.send_result(result));
    }

    /// Tells what the loop did last, and of every motion how it ended: also of one that the process's end sets aside.
    fn end(&mut self) {
        let until_ns = mono_now_ns() + LOOP_END_TIMEOUT_NS;
        let has_ended = &self.link.shared.loop_has_ended;
        while self.results.are_open() && !has_ended.load(Ordering::Acquire) {
            if mono_now_ns() > until_ns {
                break;
            }
            thread::sleep(ROUND_INTERVAL);
        }
        self.take_reports();
        self.take_returns();
        self.take_events();
        if std::mem::take(&mut self.is_held) {
            self.refuse_incoming(0.0, &TrajectoryRefusal::Waiting);
        }
        self.results.give_up(|id| self.view.path_time_s(id));
        self.results.send(|result| self.ports.send_result(result));
        self.send_batch();
        if self.has_seen_last_trajectory() {
            self.send_state();
        }
    }

    /// Whether the newest cycle known is later than the hand-over of the last trajectory. The state of an earlier cycle would say of
    /// that trajectory, once its begin is past, that the loop did not take it.
    fn has_seen_last_trajectory(&self) -> bool {
        self.handed_over_ns == i64::MIN || self.view.is_later_than(self.handed_over_ns)
    }

    fn send_state(&mut self) {
        self.told = self.view.message(&self.link.shared);
        self.ports.send_state(&self.told);
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

    /// Takes what the loop gives back, which it reported before: what has happened in that cycle is known then.
    fn take_returns(&mut self) {
        while let Ok(returned) = self.link.returns.pop() {
            self.take_reports();
            match returned {
                Return::Ended(ended) => {
                    self.note_ended(&ended);
                    self.spare.push(ended.motion);
                }
                Return::Refused(reason, motion) => {
                    self.results.refused(&Subject::from(&motion), &reason);
                    self.not_begun(motion.id, &reason);
                    self.spare.push(motion);
                }
            }
        }
    }

    fn note_ended(&mut self, ended: &EndedMotion) {
        let (id, path_time_s) = (ended.motion.id, ended.path_time_s);
        let outcome = ended.ending.code();
        let origin = ended.ending.origin().map(ToString::to_string);
        info!(id, path_time_s, origin, "motion {outcome}");
        match ended.ending {
            Ending::SetAside(_) => self.not_begun(id, &TrajectoryRefusal::SetAside),
            Ending::Reached | Ending::Joined(_) | Ending::Stopped(_) => self.view.note_ended(ended),
        }
        self.results.ended(ended, self.view.fault_reason());
    }

    /// Notes that the loop does not begin a trajectory that it was handed: one that was to be left goes on.
    fn not_begun(&mut self, id: u32, reason: &TrajectoryRefusal) {
        if self.last_taken.id == id && self.last_taken.leaves.is_some() {
            std::mem::swap(&mut self.last_taken, &mut self.taken_before);
        }
        self.note_refused(id, reason);
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
        for _ in 0..TRAJECTORIES_A_ROUND {
            if !self.is_held && !self.ports.next_trajectory(&mut self.incoming) {
                return;
            }
            self.is_held = false;
            let Some(mut motion) = self.spare.pop() else {
                self.refuse_incoming(0.0, &TrajectoryRefusal::Waiting);
                continue;
            };
            match self.accept(&mut motion) {
                Ok(()) => self.execute(motion),
                Err(TrajectoryRefusal::Waiting) => {
                    self.is_held = true;
                    self.spare.push(motion);
                    return;
                }
                Err(reason) => {
                    // A malformed one has not filled the motion.
                    let is_malformed = matches!(reason, TrajectoryRefusal::Invalid(_));
                    let duration_s = Subject::from(&motion).duration_s;
                    self.refuse_incoming(if is_malformed { 0.0 } else { duration_s }, &reason);
                    self.spare.push(motion);
                }
            }
        }
    }

    /// Checks the private copy of a trajectory completely.
    fn accept(&self, motion: &mut Motion) -> Result<(), TrajectoryRefusal> {
        wire::fill(motion, &self.incoming)?;
        if self.incoming.controller_instance != self.view.instance() {
            return Err(TrajectoryRefusal::OtherController);
        }
        self.view.check_robot(self.incoming.robot_hash)?;
        if !self.link.shared.daemon_alive.load(Ordering::Relaxed) {
            return Err(TrajectoryRefusal::DaemonSilent);
        }
        let context = self
            .view
            .acceptance_context(self.link.shared.guard_state())
            .ok_or(TrajectoryRefusal::State(LoopState::Starting))?;
        let (robot, window) = (&self.config.robot, &self.config.begin);
        check(motion, &self.last_taken, &context, robot, window)
    }

    fn execute(&mut self, motion: Motion) {
        let id = motion.id;
        info!(
            id,
            knots = motion.knots.len(),
            duration_s = motion.duration_s(),
            "trajectory accepted"
        );
        if self.link.motions.is_full() {
            self.refuse_incoming(motion.duration_s(), &TrajectoryRefusal::Waiting);
            return self.spare.push(motion);
        }
        self.results.handed_over(&motion);
        std::mem::swap(&mut self.last_taken, &mut self.taken_before);
        self.last_taken.clone_from(&motion);
        // There is room, and nobody else sends.
        let _ = self.link.motions.push(motion);
        self.handed_over_ns = mono_now_ns();
    }

    /// Refuses the trajectory that has arrived, of a motion of this duration. What repeats the id of a motion that is under way is none of
    /// its own: it has no result, and nobody is told of a refusal that would be taken for that motion's. What comes again has no result.
    fn refuse_incoming(&mut self, duration_s: f64, reason: &TrajectoryRefusal) {
        let subject = Subject {
            trajectory_id: self.incoming.trajectory_id,
            plan_id: self.incoming.plan_id,
            duration_s,
        };
        let id = subject.trajectory_id;
        if self.results.is_at_loop(id) {
            return warn!(id, %reason, "what repeats the id of a motion under way is refused");
        }
        if !matches!(reason, TrajectoryRefusal::OldId(_)) {
            self.results.refused(&subject, reason);
        }
        self.note_refused(id, reason);
    }

    fn note_refused(&mut self, id: u32, reason: &TrajectoryRefusal) {
        warn!(id, %reason, "trajectory refused");
        self.view.refused(id, reason.code());
    }
}

fn log(event: GuardEvent) {
    match event {
        GuardEvent::Commanded(SignedCommand { command, signature }, outcome) => {
            let (result, state) = (outcome.result, outcome.state);
            let (sender, pid, reason) = (signature.sender, signature.sender_pid, signature.reason);
            info!(?command, %sender, pid, %reason, ?result, %state, "command");
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

#[cfg(test)]
mod tests;
