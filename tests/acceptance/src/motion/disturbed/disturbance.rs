//! What happens to the loop around a replan, at random instants.

use std::thread::sleep;
use std::time::{Duration, Instant};

use rand::RngExt;
use rand_pcg::Pcg64;
use shared_types::clock::mono_now_ns;
use shared_types::valid::Command;
use tests::stack::{Part, Stack};

/// A reply to an order comes within this, or the loop was held.
const PROMPT: Duration = Duration::from_secs(2);
/// Longest hold of the controller alone that the robot bears, ms: `lost_setpoint_ms` is 20.
const BORNE_MS: f64 = 18.0;

/// What a group's replans are disturbed by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Disturbance {
    /// Orders of speed, pauses of the motion, and their ends.
    Speed,
    /// The controller's process is stopped for 1 to 60 ms.
    LoopHeld,
    /// The controller comes late again and again; twice with the robot for longer than the path time catches up.
    Lag,
    /// All three processes are stopped for 50 to 500 ms.
    MachinePause,
}

/// One thing that is done.
#[derive(Clone, Copy, Debug)]
pub(super) enum Action {
    Speed(f64),
    Pause,
    Resume,
    Stop(&'static [Part]),
    Continue(&'static [Part]),
}

/// Actions by their instants, ms before (below 0) or after the request.
pub(super) struct Schedule {
    actions: Vec<(f64, Action)>,
    begin: Instant,
    /// Since when the controller alone is held, nanoseconds by the clock of the messages.
    held_from_ns: Option<i64>,
    /// Holds of the controller alone that were longer than the robot bears, nanoseconds by the clock of the messages.
    long_holds_ns: Vec<[i64; 2]>,
    orders_taken: usize,
}

impl Disturbance {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Speed => "speed scaling and pauses of the motion",
            Self::LoopHeld => "pauses of the loop",
            Self::Lag => "lag of the path time",
            Self::MachinePause => "machine pause",
        }
    }

    /// Whether its actions are holds of processes and their ends, one after the other.
    pub(super) fn holds_processes(self) -> bool {
        self != Self::Speed
    }

    /// Draws what happens around one request; the switch is some 4 to 8 ms behind that.
    fn draw(self, random: &mut Pcg64) -> Vec<(f64, Action)> {
        match self {
            Self::Speed => speeds(random),
            Self::LoopHeld => {
                let at_ms = random.random_range(-10.0..12.0);
                // Every order of magnitude alike: some two thirds are shorter than what the robot bears.
                let for_ms = random.random_range(0.0..60.0_f64.ln()).exp();
                held(at_ms, for_ms, &[Part::Controller]).to_vec()
            }
            Self::Lag => late_again_and_again(random),
            Self::MachinePause => {
                let at_ms = random.random_range(-3.0..10.0);
                held(at_ms, random.random_range(50.0..500.0), &Part::ALL).to_vec()
            }
        }
    }

    /// Draws a schedule that begins now.
    pub(super) fn begin(self, random: &mut Pcg64) -> Schedule {
        let mut actions = self.draw(random);
        actions.sort_by(|a, b| a.0.total_cmp(&b.0));
        let before_ms = actions.first().map_or(0.0, |(at_ms, _)| at_ms.min(0.0));
        let before = Duration::from_secs_f64(-before_ms * 1e-3);
        Schedule {
            actions,
            begin: Instant::now() + before,
            held_from_ns: None,
            long_holds_ns: Vec::new(),
            orders_taken: 0,
        }
    }
}

fn held(at_ms: f64, for_ms: f64, parts: &'static [Part]) -> [(f64, Action); 2] {
    [
        (at_ms, Action::Stop(parts)),
        (at_ms + for_ms, Action::Continue(parts)),
    ]
}

fn speeds(random: &mut Pcg64) -> Vec<(f64, Action)> {
    let count = random.random_range(1..=3);
    let mut actions: Vec<(f64, Action)> = (0..count)
        .map(|_| {
            let at_ms = random.random_range(-15.0..12.0);
            (at_ms, Action::Speed(random.random_range(0.1..=1.0)))
        })
        .collect();
    if random.random_range(0..3) == 0 {
        let at_ms = random.random_range(-15.0..12.0);
        let for_ms = random.random_range(20.0..400.0);
        actions.extend([(at_ms, Action::Pause), (at_ms + for_ms, Action::Resume)]);
    }
    actions
}

/// Holds one after the other from 100 ms before the request until 60 ms behind it.
fn late_again_and_again(random: &mut Pcg64) -> Vec<(f64, Action)> {
    let (mut actions, mut at_ms) = (Vec::new(), -100.0);
    while at_ms < 60.0 {
        let with_robot = random.random_range(0..3) == 0;
        let (for_ms, parts): (f64, &'static [Part]) = if with_robot {
            let for_ms = random.random_range(21.0..45.0);
            (for_ms, &[Part::Robot, Part::Controller])
        } else {
            (random.random_range(2.0..BORNE_MS), &[Part::Controller])
        };
        actions.extend(held(at_ms, for_ms, parts));
        at_ms += for_ms + random.random_range(3.0..15.0);
    }
    actions
}

impl Schedule {
    /// Does what is due; returns the instants of what was done, nanoseconds by the clock of the messages.
    pub(super) fn carry_out(&mut self, stack: &mut Stack) -> anyhow::Result<Vec<i64>> {
        let now_ms = self.time_ms();
        let due = self.actions.partition_point(|(at_ms, _)| *at_ms <= now_ms);
        let due: Vec<Action> = self
            .actions
            .drain(..due)
            .map(|(_, action)| action)
            .collect();
        let mut done = Vec::new();
        for action in due {
            done.push(mono_now_ns());
            if matches!(action, Action::Stop(_)) {
                self.note_hold(action);
            }
            self.orders_taken += usize::from(action.carry_out(stack)?);
            if matches!(action, Action::Continue(_)) {
                self.note_hold(action);
            }
        }
        Ok(done)
    }

    /// Notes how long the controller alone is held.
    fn note_hold(&mut self, action: Action) {
        let now_ns = mono_now_ns();
        match action {
            Action::Stop([Part::Controller]) => self.held_from_ns = Some(now_ns),
            Action::Continue([Part::Controller]) => {
                let from_ns = self.held_from_ns.take().unwrap_or(now_ns);
                let held_ms = (now_ns - from_ns) as f64 * 1e-6;
                if held_ms > BORNE_MS {
                    self.long_holds_ns.push([from_ns, now_ns]);
                }
            }
            _ => {}
        }
    }

    /// Orders that the controller took.
    pub(super) fn orders_taken(&self) -> usize {
        self.orders_taken
    }

    /// Time since the request is due, ms; below 0: until it is.
    fn time_ms(&self) -> f64 {
        let now = Instant::now();
        let since = now.saturating_duration_since(self.begin).as_secs_f64();
        let until = self.begin.saturating_duration_since(now).as_secs_f64();
        1e3 * (since - until)
    }

    /// Holds of the controller alone that were longer than the robot bears, as they happened, nanoseconds by the clock of the messages.
    pub(super) fn long_holds_ns(&self) -> &[[i64; 2]] {
        &self.long_holds_ns
    }

    /// Whether the request is due.
    pub(super) fn is_request_due(&self) -> bool {
        self.time_ms() >= 0.0
    }

    pub(super) fn is_over(&self) -> bool {
        self.actions.is_empty()
    }
}

impl Action {
    /// Whether it was an order that the controller took.
    fn carry_out(self, stack: &mut Stack) -> anyhow::Result<bool> {
        match self {
            Self::Speed(speed) => order(stack, Command::SetSpeed(speed)),
            Self::Pause => order(stack, Command::Pause),
            Self::Resume => order(stack, Command::Resume),
            Self::Stop(parts) => {
                signal(stack, parts, libc::SIGSTOP);
                Ok(false)
            }
            Self::Continue(parts) => {
                signal(stack, parts, libc::SIGCONT);
                Ok(false)
            }
        }
    }
}

/// Whether the controller takes an order: what is refused, as where nothing moves any more, changes nothing.
fn order(stack: &mut Stack, command: Command) -> anyhow::Result<bool> {
    Ok(stack.controller.command(command, PROMPT)?.accepted)
}

fn signal(stack: &mut Stack, parts: &[Part], signal: libc::c_int) {
    if parts.len() == Part::ALL.len() {
        return stack.signal_at_once(signal);
    }
    for &part in parts {
        stack.process(part).signal(signal);
    }
}

/// Between two looks.
pub(super) fn rest() {
    sleep(Duration::from_micros(200));
}
