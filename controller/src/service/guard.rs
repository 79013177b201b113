//! The guard thread, which stops the robot: it serves `command`, watches the daemon's heartbeats, and obeys signals; nothing else,
//! so that nothing else can keep a stop from the loop.
//!
//! It never waits: not for the loop (an answer that is late is one of the next rounds' work), not for a reader of the log
//! (it hands its [`GuardEvent`]s on, and loses them where there is no room), not for a disk. It takes no trajectories and
//! publishes nothing. Should it be held up all the same, the loop sees that its rounds do not go on, and stops by itself.

use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::Duration,
};

use shared_types::{
    clock::{Suspension, mono_now_ns, suspended_ns},
    codes::{LoopState, ProcessKind},
    ipc::{self, CommandRequest, CommandServer, IpcError, IpcNode, IpcOptions, Subscriber},
    message,
    valid::Heartbeat,
};

use super::commands::Commands;
use super::link::{GuardEnd, GuardEvent};
use crate::executive::StopOrigin;

/// Sleep between two rounds of the guard.
const ROUND_INTERVAL: Duration = Duration::from_millis(1);

/// Longest wait for a cycle of the loop when the process is to end, ns: without cycles the robot cannot be brought to rest.
const SHUTDOWN_TIMEOUT_NS: i64 = 5_000_000_000;

/// The most that one round adds to the daemon's silence, ns: while the whole machine paused, no heartbeat could be sent.
const MAX_ROUND_NS: i64 = 20_000_000;

/// Commands received in one round, so that a flood of them does not keep the guard from the daemon's heartbeats.
const COMMANDS_A_ROUND: usize = 64;

/// Heartbeats received in one round, of which there are at most fifty a second from each process.
const HEARTBEATS_A_ROUND: usize = 64;

/// Settings of the guard.
pub(super) struct GuardSettings {
    /// Age of the daemon's last heartbeat at which it counts as lost, ns; `None` for never.
    pub(super) daemon_lost_ns: Option<i64>,
    /// Priority under SCHED_FIFO, below the loop's; `None` for none.
    pub(super) realtime_priority: Option<u8>,
    pub(super) signals: Signals,
}

/// Flags that signals set.
#[derive(Clone, Debug, Default)]
pub struct Signals {
    /// Whether to stop the robot along its path, then end.
    pub shutdown: Arc<AtomicBool>,
    /// Whether to stop the robot along its path: an order for when no service can be joined, as on a full disk.
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

    /// The daemon's newest heartbeat that has arrived; one with a stamp in the future is ignored, since it would never grow old.
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

/// The guard thread's state.
pub(super) struct Guard {
    settings: GuardSettings,
    ports: Ports,
    commands: Commands<CommandRequest>,
    /// Commands received in the round under way.
    received: Vec<CommandRequest>,
    ending: Option<Ending>,
    daemon_beat: Option<Heartbeat>,
    silence: DaemonSilence,
    suspension: Suspension,
}

/// The loop's newest cycle while the process ends, and since when it is the newest.
#[derive(Clone, Copy)]
struct Ending {
    cycles: u64,
    since_ns: i64,
}

/// Time since the daemon's last heartbeat, added up round by round.
#[derive(Clone, Copy, Debug)]
struct DaemonSilence {
    counted_ns: i64,
    round_ns: i64,
}

impl DaemonSilence {
    /// The silence of a daemon that has sent no heartbeat before `now_ns`.
    fn unheard(now_ns: i64) -> Self {
        Self {
            counted_ns: i64::MAX / 2,
            round_ns: now_ns,
        }
    }

    /// Counts a round at `now_ns`, in which a heartbeat with this stamp came or none did; returns the silence, ns.
    fn count(&mut self, now_ns: i64, beat_ns: Option<i64>) -> i64 {
        let elapsed_ns = (now_ns - self.round_ns).clamp(0, MAX_ROUND_NS);
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
            silence: DaemonSilence::unheard(mono_now_ns()),
            suspension: Suspension::noticed(suspended_ns()),
        })
    }

    /// Serves until it is told to shut down and the robot is at rest, or until another thread has all of them quit.
    pub(super) fn serve(mut self) {
        if let Some(priority) = self.settings.realtime_priority
            && realtime::use_fifo_priority(priority).is_err()
        {
            self.commands
                .report_event(GuardEvent::PriorityRefused(priority));
        }
        // The loop thread logs what the system refuses.
        let _ = realtime::reduce_wakeup_latency();
        while !self.commands.link.shared.is_quitting() {
            let now_ns = mono_now_ns();
            self.watch_daemon(now_ns);
            self.watch_suspension(suspended_ns());
            self.receive(now_ns);
            self.commands.attend(now_ns);
            if self.settings.signals.stop.swap(false, Ordering::Relaxed) {
                self.commands.stop(StopOrigin::Signal);
                self.commands.report_event(GuardEvent::Signalled);
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
            thread::sleep(ROUND_INTERVAL);
        }
    }

    /// Receives all commands of a round before it handles the first one: while two commands of a client are unhandled, iceoryx2 skips
    /// that client's others, so that a client that floods the service does not keep others out.
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

    /// Orders a stop while a motion is executed; true once the robot is at rest, or the loop has made no cycle for [`SHUTDOWN_TIMEOUT_NS`].
    fn may_quit(&mut self, now_ns: i64) -> bool {
        let shared = Arc::clone(&self.commands.link.shared);
        let state = shared.loop_state();
        let cycles = shared.cycles.load(Ordering::Relaxed);
        if self.ending.is_none() {
            self.commands.report_event(GuardEvent::ShuttingDown(state));
        }
        let known = self.ending.filter(|known| known.cycles == cycles);
        let since_ns = known.map_or(now_ns, |known| known.since_ns);
        self.ending = Some(Ending { cycles, since_ns });
        let is_held = now_ns - since_ns > SHUTDOWN_TIMEOUT_NS;
        if state == LoopState::Executing {
            self.commands.stop(StopOrigin::Shutdown);
        }
        let moving = matches!(state, LoopState::Executing | LoopState::Stopping);
        shared
            .is_abandoned
            .store(moving && is_held, Ordering::Relaxed);
        !moving || is_held
    }

    fn watch_daemon(&mut self, now_ns: i64) {
        let beat_ns = self.take_daemon_heartbeat();
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
        self.commands.report_event(event);
    }

    /// Orders a stop after a suspension of the machine: no clock of the programs counts it, and obstacles may have moved meanwhile.
    fn watch_suspension(&mut self, suspended_ns: i64) {
        if self.suspension.is_longer(suspended_ns) {
            self.commands.stop(StopOrigin::Suspension);
            self.commands.report_event(GuardEvent::Suspended);
        }
    }

    /// Receives the daemon's heartbeats and returns the newest one's stamp, ns. Where another daemon has taken the place of one that was
    /// not lost, it knows nothing of that one's motion, which is stopped like that of a lost daemon.
    fn take_daemon_heartbeat(&mut self) -> Option<i64> {
        let beat = self.ports.newest_daemon_heartbeat()?;
        let last = self.daemon_beat.replace(beat);
        let another = last.is_some_and(|last| last.instance != beat.instance);
        if another && self.settings.daemon_lost_ns.is_some() {
            self.commands.stop(StopOrigin::OtherDaemon);
            self.commands.report_event(GuardEvent::DaemonReplaced);
        }
        // After the stop: a state that names this daemon tells of the stop too.
        self.commands.link.shared.set_daemon(beat.instance);
        Some(beat.stamp_mono_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    #[test]
    fn a_daemon_is_silent_for_as_long_as_a_heart_could_have_beaten() {
        let mut silence = DaemonSilence::unheard(0);
        assert!(silence.count(MS, None) > 3_600_000 * MS, "nobody was heard");
        assert_eq!(silence.count(5_000 * MS, Some(4_995 * MS)), 5 * MS);
        // A pause of the whole machine, and a heartbeat from before it that arrives late.
        assert_eq!(silence.count(5_400 * MS, None), 25 * MS);
        assert_eq!(silence.count(5_401 * MS, Some(4_999 * MS)), 26 * MS);
        for round in 0..200 {
            silence.count((5_402 + round) * MS, None);
        }
        assert_eq!(silence.count(5_602 * MS, None), 227 * MS);
        assert_eq!(silence.count(5_603 * MS, Some(5_603 * MS)), 0);
    }
}
