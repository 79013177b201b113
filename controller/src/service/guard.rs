//! The guard thread: what stops the robot. It serves `command`, watches the daemon's heart, and obeys signals; nothing else,
//! so that nothing else can keep a stop from the loop.
//!
//! It never waits: not for the loop (an answer that is late is one of the next rounds' work), not for a reader of the log
//! (it hands its [`GuardEvent`]s on, and loses them where there is no room), not for a disk. It takes no trajectories and
//! publishes nothing. Should it be held up all the same, the loop sees that its rounds do not go on, and stops by itself.
//!
//! A stop is a number that only rises: the loop obeys it whenever it runs again, and the reply says what is true when it is
//! sent. An order to reset or to change the speed is offered to the loop; one that it does not take in time is withdrawn
//! before it is answered "loop busy".

use std::{
    collections::VecDeque,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::Duration,
};

use shared_types::{
    PROTOCOL_VERSION,
    clock::{Suspension, mono_now_ns, suspended_ns},
    codes::{CommandRefusal, LoopState, ProcessKind},
    ipc::{self, CommandRequest, CommandServer, IpcError, IpcNode, IpcOptions, Subscriber},
    message,
    valid::{Command, Heartbeat},
};

use super::link::{Answer, GuardEnd, GuardEvent, NumberedOrder, Order, Outcome};

const TICK: Duration = Duration::from_millis(1);

/// The longest that the loop is waited for to take a command, ns.
const COMMAND_NS: i64 = 50_000_000;

/// Longest wait for a cycle of the loop when the process is to end, ns: without one the robot cannot be brought to rest.
const SHUTDOWN_NS: i64 = 5_000_000_000;

/// Longest time that one round counts for in the daemon's silence, ns: where the whole machine paused, no heart could beat.
const MOST_A_ROUND_NS: i64 = 20_000_000;

/// Commands received in one round, so that a flood of them does not keep the guard from the daemon's heart.
const COMMANDS_A_ROUND: usize = 64;

/// Heartbeats received in one round, of which there are at most fifty a second from each process.
const HEARTBEATS_A_ROUND: usize = 64;

/// What the guard is told by the configuration and by the process.
pub(super) struct GuardSettings {
    /// Age of the daemon's last heartbeat at which it counts as lost, ns; `None` for never.
    pub(super) daemon_lost_ns: Option<i64>,
    /// Priority under SCHED_FIFO, below the loop's; `None` for none.
    pub(super) realtime_priority: Option<u8>,
    pub(super) signals: Signals,
}

/// What signals have set.
#[derive(Clone, Debug, Default)]
pub struct Signals {
    /// Stop the robot along its path, then end.
    pub shutdown: Arc<AtomicBool>,
    /// Stop the robot along its path: an order for when no service can be joined, as on a full disk.
    pub stop: Arc<AtomicBool>,
}

/// The guard's ports.
struct Ports {
    commands: CommandServer,
    heartbeats: Subscriber<message::Heartbeat>,
    // Declared last: the node outlives its ports.
    _node: IpcNode,
}

impl Ports {
    fn open(options: &IpcOptions) -> Result<Self, IpcError> {
        let node = IpcNode::create(options, "controller-guard")?;
        Ok(Self {
            commands: ipc::command_server(&node, &ipc::command_service(&node)?)?,
            heartbeats: ipc::subscriber(&node, &ipc::heartbeat_service(&node)?)?,
            _node: node,
        })
    }

    /// The daemon's newest heartbeat that has arrived; one from the future would never grow old, and is none.
    fn newest_daemon_heartbeat(&self) -> Option<Heartbeat> {
        let mut newest: Option<Heartbeat> = None;
        for _ in 0..HEARTBEATS_A_ROUND {
            let Ok(Some(sample)) = self.heartbeats.receive() else {
                break;
            };
            let copy = *sample;
            let Ok(beat) = Heartbeat::try_from(&copy) else {
                continue;
            };
            let newer = newest.is_none_or(|newest| newest.stamp_mono_ns <= beat.stamp_mono_ns);
            if beat.kind == ProcessKind::Daemon && newer && beat.stamp_mono_ns <= mono_now_ns() {
                newest = Some(beat);
            }
        }
        newest
    }
}

/// A command that is not answered yet.
struct Asked<R> {
    request: R,
    command_id: u64,
    command: Command,
    received_ns: i64,
}

/// Where a reply goes: a request in shared memory, or a test's.
pub(super) trait Request {
    /// Whether its sender still waits for the reply.
    fn is_awaited(&self) -> bool;
    fn reply(&self, reply: message::CommandReply);
}

impl Request for CommandRequest {
    fn is_awaited(&self) -> bool {
        self.is_connected()
    }

    fn reply(&self, reply: message::CommandReply) {
        // Who asked is gone, or finds out by its own patience.
        let _ = self.send_copy(reply);
    }
}

/// The commands under way between their senders and the loop.
struct Commands<R> {
    link: GuardEnd,
    /// Stops with their numbers, in order.
    stops: VecDeque<(u64, Asked<R>)>,
    /// Orders to reset and to change the speed, in order.
    orders: VecDeque<(Order, Asked<R>)>,
    /// The number under which the first of them was offered to the loop.
    offered: Option<u64>,
    last_id: u64,
}

impl<R: Request> Commands<R> {
    fn new(link: GuardEnd) -> Self {
        Self {
            link,
            stops: VecDeque::new(),
            orders: VecDeque::new(),
            offered: None,
            last_id: 0,
        }
    }

    /// A stop that nobody waits for the outcome of.
    fn stop(&self) -> u64 {
        // By the clock as it is now: later than whatever had the stop sent.
        self.link.shared.order_stop(mono_now_ns())
    }

    fn take(&mut self, request: R, wire: &message::Command, now_ns: i64) {
        let command_id = wire.command_id;
        let command = match Command::try_from(wire) {
            Ok(command) => command,
            Err(invalid) => {
                let reason = match invalid.field {
                    "protocol_version" => CommandRefusal::WrongVersion,
                    "speed" => CommandRefusal::InvalidSpeed,
                    _ => CommandRefusal::UnknownKind,
                };
                let outcome = self.untaken(reason);
                return request.reply(reply(command_id, outcome));
            }
        };
        let asked = Asked {
            request,
            command_id,
            command,
            received_ns: now_ns,
        };
        match command {
            // Its sender has been told that it may not have arrived, or has ended.
            Command::ResetFault | Command::SetSpeed(_) if !asked.request.is_awaited() => {}
            Command::Stop => {
                let number = self.stop();
                self.stops.push_back((number, asked));
            }
            Command::ResetFault => {
                // Who resets looks at the robot as it is now: what was wanted before the fault waits for nobody's reset.
                self.link.shared.forget_requests(mono_now_ns());
                self.orders.push_back((Order::Reset, asked));
            }
            Command::SetSpeed(speed) => self.orders.push_back((Order::Speed(speed), asked)),
        }
    }

    /// Hears the loop, answers what it has carried out or does not take in time, and offers it the next order.
    fn attend(&mut self, now_ns: i64) {
        while let Ok(answer) = self.link.answers.pop() {
            match answer {
                Answer::Stops { up_to, outcome } => self.answer_stops(up_to, outcome),
                Answer::Order { id, outcome } if self.offered == Some(id) => {
                    self.offered = None;
                    self.answer_first_order(outcome);
                }
                // Every order that is taken is the one offered.
                Answer::Order { .. } => {}
            }
        }
        self.give_up_late(now_ns);
        self.offer_next();
    }

    fn answer_stops(&mut self, up_to: u64, outcome: Outcome) {
        self.answer_stops_while(outcome, |number, _| number <= up_to);
    }

    fn answer_stops_while(&mut self, outcome: Outcome, wanted: impl Fn(u64, &Asked<R>) -> bool) {
        let is_wanted = |(number, asked): &(u64, Asked<R>)| wanted(*number, asked);
        while self.stops.front().is_some_and(is_wanted) {
            if let Some((_, asked)) = self.stops.pop_front() {
                self.answer(&asked, outcome);
            }
        }
    }

    fn answer_first_order(&mut self, outcome: Outcome) {
        if let Some((_, asked)) = self.orders.pop_front() {
            self.answer(&asked, outcome);
        }
    }

    fn give_up_late(&mut self, now_ns: i64) {
        let late = |asked: &Asked<R>| now_ns - asked.received_ns > COMMAND_NS;
        self.answer_stops_while(self.untaken(CommandRefusal::StopPending), |_, asked| {
            late(asked)
        });
        while self.orders.front().is_some_and(|(_, asked)| late(asked)) {
            if let Some(id) = self.offered {
                if !self.link.shared.offer.take(id) {
                    // The loop has it, and answers.
                    return;
                }
                self.offered = None;
            }
            self.answer_first_order(self.untaken(CommandRefusal::LoopBusy));
        }
    }

    fn offer_next(&mut self) {
        let Some((order, _)) = self.orders.front().filter(|_| self.offered.is_none()) else {
            return;
        };
        let (id, order) = (self.last_id + 1, *order);
        // Before it is in the ring: the loop must find it on offer. Where the ring is full of withdrawn orders nobody takes it.
        self.link.shared.offer.make(id);
        if self.link.orders.push(NumberedOrder { id, order }).is_ok() {
            (self.last_id, self.offered) = (id, Some(id));
        } else {
            self.link.shared.offer.take(id);
        }
    }

    fn untaken(&self, reason: CommandRefusal) -> Outcome {
        Outcome {
            result: Err(reason),
            state: self.link.shared.loop_state(),
        }
    }

    fn answer(&mut self, asked: &Asked<R>, outcome: Outcome) {
        asked.request.reply(reply(asked.command_id, outcome));
        self.tell(GuardEvent::Commanded(asked.command, outcome));
    }

    fn tell(&mut self, event: GuardEvent) {
        if self.link.events.push(event).is_err() {
            self.link.shared.events_lost.fetch_add(1, Ordering::Relaxed);
        }
    }
}

fn reply(command_id: u64, outcome: Outcome) -> message::CommandReply {
    message::CommandReply {
        command_id,
        protocol_version: PROTOCOL_VERSION,
        accepted: u32::from(outcome.result.is_ok()),
        reason: outcome.result.err().unwrap_or(CommandRefusal::None).code(),
        state: outcome.state.code(),
    }
}

/// The guard thread's state.
pub(super) struct Guard {
    settings: GuardSettings,
    ports: Ports,
    commands: Commands<CommandRequest>,
    /// Commands of the round under way.
    received: Vec<CommandRequest>,
    ending: Option<Ending>,
    daemon_beat: Option<Heartbeat>,
    silence: Silence,
    suspension: Suspension,
}

/// The loop's last cycle known while the process ends, and since when.
#[derive(Clone, Copy)]
struct Ending {
    cycles: u64,
    since_ns: i64,
}

/// How long the daemon's heart has not beaten, in rounds' time.
#[derive(Clone, Copy, Debug)]
struct Silence {
    counted_ns: i64,
    round_ns: i64,
}

impl Silence {
    /// Nothing was heard before `now_ns`.
    fn of_nobody(now_ns: i64) -> Self {
        Self {
            counted_ns: i64::MAX / 2,
            round_ns: now_ns,
        }
    }

    /// Counts a round at `now_ns`, in which a heartbeat with this stamp came or none did; returns the silence, ns.
    fn count(&mut self, now_ns: i64, beat_ns: Option<i64>) -> i64 {
        let elapsed_ns = (now_ns - self.round_ns).clamp(0, MOST_A_ROUND_NS);
        self.round_ns = now_ns;
        self.counted_ns = self.counted_ns.saturating_add(elapsed_ns);
        if let Some(beat_ns) = beat_ns {
            self.counted_ns = self.counted_ns.min(now_ns - beat_ns);
        }
        self.counted_ns
    }
}

impl Guard {
    /// Opens the ports.
    ///
    /// # Errors
    /// [`IpcError`] where a service or port cannot be opened.
    pub(super) fn open(
        settings: GuardSettings,
        options: &IpcOptions,
        link: GuardEnd,
    ) -> Result<Self, IpcError> {
        Ok(Self {
            settings,
            ports: Ports::open(options)?,
            commands: Commands::new(link),
            received: Vec::with_capacity(COMMANDS_A_ROUND),
            ending: None,
            daemon_beat: None,
            silence: Silence::of_nobody(mono_now_ns()),
            suspension: Suspension::noticed(suspended_ns()),
        })
    }

    /// Serves until it is told to shut down and the robot is at rest, or until another thread has all of them quit.
    pub(super) fn serve(mut self) {
        if let Some(priority) = self.settings.realtime_priority
            && realtime::use_fifo_priority(priority).is_err()
        {
            self.commands.tell(GuardEvent::PriorityRefused(priority));
        }
        // The loop says what the system refuses.
        let _ = realtime::reduce_wakeup_latency();
        while !self.commands.link.shared.is_quitting() {
            let now_ns = mono_now_ns();
            self.watch_daemon(now_ns);
            self.watch_suspension(suspended_ns());
            self.receive(now_ns);
            self.commands.attend(now_ns);
            if self.settings.signals.stop.swap(false, Ordering::Relaxed) {
                self.commands.stop();
                self.commands.tell(GuardEvent::Signalled);
            }
            if self.settings.signals.shutdown.load(Ordering::Relaxed) && self.may_quit(now_ns) {
                self.commands
                    .link
                    .shared
                    .quit
                    .store(true, Ordering::Relaxed);
            }
            let rounds = &self.commands.link.shared.guard_rounds;
            rounds.fetch_add(1, Ordering::Relaxed);
            thread::sleep(TICK);
        }
    }

    /// Takes up the commands of a round only once all are received: as long as two of a client's are not, iceoryx2 passes over that
    /// client's others, so that one who floods does not keep out who comes after it.
    fn receive(&mut self, now_ns: i64) {
        while self.received.len() < COMMANDS_A_ROUND
            && let Ok(Some(request)) = self.ports.commands.receive()
        {
            self.received.push(request);
        }
        for request in self.received.drain(..) {
            let command = *request;
            self.commands.take(request, &command, now_ns);
        }
    }

    /// On the first call orders a stop, and again while one is to be ordered; true once the robot is at rest, or the loop has made
    /// no cycle for [`SHUTDOWN_NS`].
    fn may_quit(&mut self, now_ns: i64) -> bool {
        let shared = Arc::clone(&self.commands.link.shared);
        let state = shared.loop_state();
        let cycles = shared.cycles.load(Ordering::Relaxed);
        if self.ending.is_none() {
            self.commands.tell(GuardEvent::ShuttingDown(state));
        }
        let known = self.ending.filter(|known| known.cycles == cycles);
        let since_ns = known.map_or(now_ns, |known| known.since_ns);
        self.ending = Some(Ending { cycles, since_ns });
        let is_held = now_ns - since_ns > SHUTDOWN_NS;
        if state == LoopState::Executing {
            self.commands.stop();
        }
        let moving = matches!(state, LoopState::Executing | LoopState::Stopping);
        shared
            .is_abandoned
            .store(moving && is_held, Ordering::Relaxed);
        !moving || is_held
    }

    fn watch_daemon(&mut self, now_ns: i64) {
        let beat_ns = self.hear_daemon();
        let silence_ns = self.silence.count(now_ns, beat_ns);
        let limit_ns = self.settings.daemon_lost_ns;
        let alive = limit_ns.is_none_or(|limit_ns| silence_ns <= limit_ns);
        let shared = &self.commands.link.shared;
        let was_alive = shared.daemon_alive.swap(alive, Ordering::Relaxed);
        let event = match (was_alive, alive) {
            (true, false) => GuardEvent::DaemonLost(shared.loop_state()),
            (false, true) => GuardEvent::DaemonFound,
            _ => return,
        };
        self.commands.tell(event);
    }

    /// Stops after a suspension of the machine: no clock of the chain saw it, and nobody knows what stands in the way now.
    fn watch_suspension(&mut self, suspended_ns: i64) {
        if self.suspension.is_longer(suspended_ns) {
            self.commands.stop();
            self.commands.tell(GuardEvent::Suspended);
        }
    }

    /// Takes in the daemon's heartbeats. A daemon that comes so soon after another that its heart was not missed knows
    /// nothing of that one's motion: it is stopped, like that of a lost daemon. Returns the newest one's stamp, ns.
    fn hear_daemon(&mut self) -> Option<i64> {
        let beat = self.ports.newest_daemon_heartbeat()?;
        let last = self.daemon_beat.replace(beat);
        let another = last.is_some_and(|last| last.instance != beat.instance);
        self.commands.link.shared.set_daemon(beat.instance);
        if another && self.settings.daemon_lost_ns.is_some() {
            self.commands.stop();
            self.commands.tell(GuardEvent::DaemonReplaced);
        }
        Some(beat.stamp_mono_ns)
    }
}

#[cfg(test)]
mod tests;
