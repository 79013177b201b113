//! The relay thread: serves everyone who comes and goes, so that the loop's own peers stay fixed.
//!
//! It copies and checks trajectories, takes commands, publishes state and cycles, watches the daemon's heart, and cleans
//! up after dead processes.

use std::{
    sync::atomic::{AtomicBool, Ordering},
    thread,
    time::Duration,
};

use shared_types::{
    PROTOCOL_VERSION,
    clock::mono_now_ns,
    codes::{CommandRefusal, LoopState},
    ipc::{CYCLES_PER_BATCH, IpcError, IpcOptions},
    message::{self, CommandReply, Cycle, TrajectoryMessage},
    valid::{Command, Heartbeat},
};
use tracing::{debug, info, warn};

use super::{
    config::ControllerConfig,
    link::{Answer, Order, RelayEnd},
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

/// The longest that the loop is waited for to take a command, in ticks.
const COMMAND_TICKS: usize = 25;

/// The longest stop that a shutdown waits for, ns: far above v / a of any robot.
const SHUTDOWN_NS: i64 = 5_000_000_000;

/// Commands served in one round, so that a flood of them does not keep the relay from the rest.
const COMMANDS_A_ROUND: usize = 4;

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
pub(super) struct Relay<'a> {
    config: &'a ControllerConfig,
    ports: Ports,
    link: RelayEnd,
    view: View,
    spare: Vec<Motion>,
    incoming: Box<TrajectoryMessage>,
    batch: Vec<Cycle>,
    last_taken: Option<(u32, i64)>,
    daemon_beat: Option<Heartbeat>,
    command_answer: Option<Result<(), CommandRefusal>>,
}

impl<'a> Relay<'a> {
    /// Opens the ports, and lets pass what was meant for a controller before this one: a restarted controller never
    /// resumes a motion by itself.
    ///
    /// # Errors
    /// [`IpcError`] where a service or port cannot be opened.
    pub(super) fn open(
        config: &'a ControllerConfig,
        options: &IpcOptions,
        link: RelayEnd,
    ) -> Result<Self, IpcError> {
        let mut relay = Self {
            config,
            ports: Ports::open(options)?,
            link,
            view: View::new(config.executive.period_ns),
            spare: (0..MOTIONS).map(|_| Motion::empty()).collect(),
            incoming: Box::new(TrajectoryMessage::ZEROED),
            batch: Vec::with_capacity(CYCLES_PER_BATCH),
            last_taken: None,
            daemon_beat: None,
            command_answer: None,
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

    /// The loop's thread id is published with the state.
    pub(super) fn set_loop_thread(&mut self, thread_id: u32) {
        self.view.set_loop_thread(thread_id);
    }

    /// Serves until `shutdown` is set and the robot is at rest, or until the loop has ended by itself.
    pub(super) fn serve(&mut self, shutdown: &AtomicBool, loop_ended: impl Fn() -> bool) {
        let (mut batch, mut state) = (Due::every(BATCH_EVERY_NS), Due::every(STATE_EVERY_NS));
        let mut tidy = Due::every(TIDY_EVERY_NS);
        let mut give_up_ns = None;
        while !loop_ended() {
            let now_ns = mono_now_ns();
            self.take_reports();
            self.take_answers();
            self.watch_daemon(now_ns);
            self.take_trajectories();
            self.serve_commands();
            if batch.is_due(now_ns) {
                self.send_batch();
            }
            if state.is_due(now_ns) {
                self.ports.send_state(&self.view.message());
                self.ports.send_heartbeat();
            }
            if tidy.is_due(now_ns) {
                self.ports.tidy();
            }
            if shutdown.load(Ordering::Relaxed) && self.may_quit(&mut give_up_ns, now_ns) {
                break;
            }
            thread::sleep(TICK);
        }
        self.link.shared.quit.store(true, Ordering::Relaxed);
        self.send_batch();
        self.ports.send_state(&self.view.message());
    }

    /// On the first call orders a stop; true once the robot is at rest (or does not come to rest).
    fn may_quit(&mut self, give_up_ns: &mut Option<i64>, now_ns: i64) -> bool {
        let moving = matches!(
            self.view.state(),
            LoopState::Executing | LoopState::Stopping
        );
        let limit_ns = *give_up_ns.get_or_insert_with(|| {
            if moving {
                info!("shutting down: stopping the robot along its path");
            } else {
                info!("shutting down");
            }
            now_ns + SHUTDOWN_NS
        });
        if self.view.state() == LoopState::Executing {
            // Nothing to do is a good answer here, too.
            let _ = self.order(Order::Stop);
        }
        !moving || now_ns > limit_ns
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

    fn take_answers(&mut self) {
        while let Ok(answer) = self.link.answers.pop() {
            match answer {
                Answer::Command(result) => self.command_answer = Some(result),
                Answer::Finished(motion) => self.spare.push(motion),
                Answer::Refused(reason, motion) => {
                    self.refuse(motion.id, &reason);
                    self.spare.push(motion);
                }
            }
        }
    }

    fn watch_daemon(&mut self, now_ns: i64) {
        self.hear_daemon();
        let alive = match (self.config.daemon_lost_ns, self.daemon_beat) {
            (None, _) => true,
            (Some(limit_ns), Some(beat)) => now_ns - beat.stamp_mono_ns <= limit_ns,
            (Some(_), None) => false,
        };
        let was_alive = self.link.shared.daemon_alive.swap(alive, Ordering::Relaxed);
        match (was_alive, alive) {
            (true, false) => {
                let state = self.view.state();
                warn!(%state, "the daemon's heart has stopped: a motion is stopped along its path");
            }
            (false, true) => info!("the daemon's heart beats"),
            _ => {}
        }
    }

    /// Takes in the daemon's heartbeats. A daemon that comes so soon after another that its heart was not missed knows
    /// nothing of that one's motion: it is stopped, like that of a lost daemon.
    fn hear_daemon(&mut self) {
        let Some(beat) = self.ports.newest_daemon_heartbeat() else {
            return;
        };
        let another = self
            .daemon_beat
            .is_some_and(|last| last.pid != beat.pid || last.sequence >= beat.sequence);
        self.daemon_beat = Some(beat);
        if another && self.config.daemon_lost_ns.is_some() && self.order(Order::Stop).is_ok() {
            warn!(
                "another daemon is there: the motion of the one before is stopped along its path"
            );
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
            .situation(self.last_taken)
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
        match self.link.orders.push(Order::Execute(motion)) {
            Ok(()) => self.last_taken = Some((id, begin_ns)),
            Err(rtrb::PushError::Full(order)) => {
                self.refuse(id, &Unacceptable::Waiting);
                if let Order::Execute(motion) = order {
                    self.spare.push(motion);
                }
            }
        }
    }

    fn refuse(&mut self, id: u32, reason: &Unacceptable) {
        warn!(id, %reason, "trajectory refused");
        self.view.refused(id, reason.code());
    }

    fn serve_commands(&mut self) {
        for _ in 0..COMMANDS_A_ROUND {
            let Ok(Some(request)) = self.ports.commands.receive() else {
                return;
            };
            let command = *request;
            let result = self.obey(&command);
            self.take_reports();
            let reply = CommandReply {
                command_id: command.command_id,
                protocol_version: PROTOCOL_VERSION,
                accepted: u32::from(result.is_ok()),
                reason: result.err().unwrap_or(CommandRefusal::None).code(),
                state: self.view.state().code(),
            };
            if let Err(error) = request.send_copy(reply) {
                debug!(?error, "cannot answer a command");
            }
        }
    }

    fn obey(&mut self, command: &message::Command) -> Result<(), CommandRefusal> {
        let command = Command::try_from(command).map_err(|invalid| match invalid.field {
            "protocol_version" => CommandRefusal::WrongVersion,
            "speed" => CommandRefusal::InvalidSpeed,
            _ => CommandRefusal::UnknownKind,
        })?;
        let result = self.order(match command {
            Command::Stop => Order::Stop,
            Command::ResetFault => Order::Reset,
            Command::SetSpeed(speed) => Order::Speed(speed),
        });
        info!(?command, ?result, "command");
        result
    }

    /// Has the loop carry out an order, and waits for its answer.
    fn order(&mut self, order: Order) -> Result<(), CommandRefusal> {
        self.command_answer = None;
        self.link
            .orders
            .push(order)
            .map_err(|_| CommandRefusal::LoopBusy)?;
        for _ in 0..COMMAND_TICKS {
            self.take_answers();
            if let Some(answer) = self.command_answer.take() {
                return answer;
            }
            thread::sleep(TICK);
        }
        Err(CommandRefusal::LoopBusy)
    }
}
