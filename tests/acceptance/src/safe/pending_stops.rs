//! A stop that comes while the loop is held: it is carried out as soon as the loop goes on.
//!
//! The robot is one that bears 200 ms without a set-point and goes on meanwhile, so that nothing but the stop can stop it.

use std::thread::sleep;
use std::time::Duration;

use shared_types::clock::mono_now_ns;
use shared_types::codes::{CommandRefusal, LoopFault, LoopState};
use shared_types::message::Cycle;
use shared_types::valid::{Command, CommandReply, Goal};
use tests::fake_robot::{FakeRobot, Misbehaviour};
use tests::listener::Listener;
use tests::outside::thread_named;
use tests::stack::{Part, Stack};
use tests::system_calls::HeldThread;
use tests::world::Settings;
use toml::Value;

use crate::report::Report;
use crate::scale::Scale;

const SHAPES: [[f64; 6]; 2] = [
    [0.9, -0.6, 0.5, 0.7, -0.7, 0.9],
    [-0.8, 0.7, -0.6, -0.5, 0.8, -0.7],
];
const PROMPT: Duration = Duration::from_secs(5);
/// More than the robot moves in the time for which its loop is held, rad.
const TOLERANCE_RAD: f64 = 0.1;
/// Enough for any stop, and less than what is left of the motions.
const LOOK: Duration = Duration::from_millis(800);
/// Cycles that a loop may drive on once it is released: the one under way.
const DRIVEN_ON: usize = 1;
/// How much longer than with a loop that runs a stop may take: the longest that a late cycle goes on, and a cycle.
const ALLOWANCE_MS: f64 = 21.0;

pub(crate) fn run(report: &mut Report, scale: Scale) {
    let command = "acceptance safe, pending stops";
    report.group("stops of a loop that is held", command, |report| {
        tried(report, scale)
    });
}

/// A controller, its loop's thread, and what it publishes.
struct Held {
    stack: Stack,
    listener: Listener,
    hard_loop: u32,
    turn: usize,
    _robot: FakeRobot,
}

/// What the cycles after an order say.
#[derive(Debug)]
struct Course {
    /// Cycles that were still executing.
    driven_on: usize,
    /// From the first of them to the first that holds, ms; none where it never does.
    rest_ms: Option<f64>,
    /// Its states, each once where it follows itself.
    _states: Vec<u32>,
    /// How long the loop was held, ms, and the fault that it ended in.
    _held: (f64, LoopFault),
}

impl Held {
    fn start() -> anyhow::Result<Self> {
        let mut stack = Stack::new(&Settings {
            // The robot stands where it was last told to while the loop is held.
            daemon: vec![("path_tolerance_rad", Value::Float(TOLERANCE_RAD))],
            ..Settings::default()
        });
        let (options, robot) = (&stack.world.options, &stack.world.robot);
        let robot = FakeRobot::start(options, robot, Misbehaviour::None);
        stack.start(Part::Daemon);
        stack.start(Part::Controller);
        stack.wait_until_ready()?;
        let controller = stack.process(Part::Controller).pid();
        Ok(Self {
            listener: Listener::start(&stack.world.options),
            hard_loop: thread_named(controller, "hard-loop"),
            turn: 0,
            _robot: robot,
            stack,
        })
    }

    /// Gives an order half a second into a motion, to a loop that is held or one that runs; its reply, and the cycles afterwards.
    fn order(&mut self, is_held: bool, command: Command) -> anyhow::Result<(CommandReply, Course)> {
        self.turn += 1;
        let goal = Goal::Configuration(SHAPES[self.turn % 2]);
        let id = self.stack.begin_motion(goal)?;
        self.stack.wait_for_progress(id, 0.5)?;
        let held = is_held.then(|| HeldThread::hold(self.hard_loop));
        let held = held.transpose()?;
        let begin_ns = mono_now_ns();
        let reply = self.stack.controller.command(command, PROMPT)?;
        let since_ns = match held {
            Some(held) => {
                let now_ns = mono_now_ns();
                held.release()?;
                now_ns
            }
            None => begin_ns,
        };
        sleep(LOOK);
        let cycles = self.listener.take().cycles;
        let mut course = Course::of(&cycles, since_ns);
        let held_ms = (since_ns - begin_ns) as f64 * 1e-6;
        course._held = (held_ms, self.stack.controller_state().fault);
        let _ = self.stack.controller.command(Command::Stop, PROMPT)?;
        // A loop that was held may have lost its robot meanwhile.
        self.stack.clear_fault()?;
        Ok((reply, course))
    }
}

impl Course {
    fn of(cycles: &[Cycle], since_ns: i64) -> Self {
        let after: Vec<&Cycle> = cycles
            .iter()
            .filter(|cycle| cycle.stamp_mono_ns > since_ns)
            .collect();
        let is = |state: LoopState| move |cycle: &&&Cycle| cycle.state == state.code();
        let executing = after.iter().take_while(is(LoopState::Executing)).count();
        let holding = after.iter().find(is(LoopState::Holding));
        let was_stopped = after
            .iter()
            .any(|cycle| cycle.state == LoopState::Stopping.code());
        let rest = holding.filter(|_| was_stopped);
        let ms = |cycle: &&Cycle| (cycle.stamp_mono_ns - since_ns) as f64 * 1e-6;
        let mut states: Vec<u32> = after.iter().map(|cycle| cycle.state).collect();
        states.dedup();
        Self {
            driven_on: executing,
            rest_ms: rest.map(ms),
            _states: states,
            _held: (0.0, LoopFault::None),
        }
    }
}

fn tried(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let mut held = Held::start()?;
    premise(&mut held)?;
    let (mut usual_ms, mut longest_ms) = (0.0_f64, 0.0_f64);
    let (mut untold, mut wrong) = (Vec::new(), Vec::new());
    let tries = scale.pick(4, 30);
    for turn in 0..tries {
        match held.order(false, Command::Stop) {
            Ok((_, course)) if course.rest_ms.is_some() => {
                usual_ms = usual_ms.max(course.rest_ms.unwrap_or_default());
            }
            other => wrong.push(format!("try {turn}, nothing held: {other:?}")),
        }
        let (reply, course) = match held.order(true, Command::Stop) {
            Ok(ordered) => ordered,
            Err(error) => {
                wrong.push(format!("try {turn}: {error:#}"));
                held.stack.clear_fault()?;
                continue;
            }
        };
        if reply.accepted || reply.refusal != CommandRefusal::StopPending {
            untold.push(format!("try {turn}: {}", reply.refusal));
        }
        match course.rest_ms {
            Some(ms) if course.driven_on <= DRIVEN_ON => longest_ms = longest_ms.max(ms),
            _ => wrong.push(format!("try {turn}: {course:?}")),
        }
    }
    let name =
        "defect 8: stops that a held loop has not taken, not answered as ones that stay in force";
    report.none_of(name, &untold);
    let name = format!(
        "defect 8: motions of {tries} that go on for more than {DRIVEN_ON} cycle once the loop is released, or end otherwise"
    );
    report.none_of(&name, &wrong);
    let name = format!(
        "defect 8: from the loop's release to rest, ms (from an order that is heard: {usual_ms:.0})"
    );
    report.at_most(&name, longest_ms, usual_ms + ALLOWANCE_MS);
    Ok(())
}

/// A loop that is held and gets no stop goes on once it is released.
fn premise(held: &mut Held) -> anyhow::Result<()> {
    let (_, course) = held.order(true, Command::SetSpeed(1.0))?;
    let goes_on = course.driven_on > 500 && course.rest_ms.is_none();
    anyhow::ensure!(goes_on, "the premise, a loop that goes on: {course:?}");
    Ok(())
}
