//! What the controller makes of a robot driver that lies, and how it says what it waits for.

use std::sync::LazyLock;
use std::thread;
use std::time::Duration;

use shared_types::codes::{LoopFault, LoopState, Refusal, Waiting};
use shared_types::message::Cycle;
use shared_types::valid::{Command, ControllerState, Goal};
use tests::fake_robot::{FakeRobot, Misbehaviour};
use tests::listener::Listener;
use tests::process::wait_for;
use tests::raw_daemon::RawDaemon;
use tests::stack::{PATIENCE, Part, Stack};
use tests::world::{Settings, shipped_number};
use toml::Value;

use crate::report::Report;
use crate::scale::Scale;

const SHAPES: [[f64; 6]; 2] = [
    [0.9, -0.6, 0.5, 0.7, -0.7, 0.9],
    [-0.8, 0.7, -0.6, -0.5, 0.8, -0.7],
];
const PROMPT: Duration = Duration::from_secs(5);
/// A cycle of the shipped controller, ms.
static PERIOD_MS: LazyLock<f64> =
    LazyLock::new(|| 1e3 / shipped_number("controller.toml", "rate_hz"));
/// The shipped `robot_lost_ms`, and a cycle each for the state under way and for the order of the threads.
static LOST_MS: LazyLock<f64> =
    LazyLock::new(|| shipped_number("controller.toml", "robot_lost_ms") + 2.0 * *PERIOD_MS);

pub(crate) fn run(report: &mut Report, scale: Scale) {
    let command = "acceptance safe, controller";
    report.group("robot drivers that lie", command, |report| {
        liars(report, scale)
    });
    report.group("what a controller waits for", command, waiting);
    report.group("path tolerance", command, tolerance);
}

/// A daemon, a controller and a robot driver of the test's own.
struct Stand {
    stack: Stack,
    robot: FakeRobot,
}

impl Stand {
    fn new(misbehaviour: Misbehaviour) -> Self {
        let mut stack = Stack::new(&Settings::default());
        let robot = FakeRobot::start(&stack.world.options, &stack.world.robot, misbehaviour);
        stack.start(Part::Daemon);
        stack.start(Part::Controller);
        Self { stack, robot }
    }

    /// The first new state of the controller that `is` holds of.
    fn wait_for(
        &mut self,
        what: &str,
        is: impl Fn(&ControllerState) -> bool,
    ) -> anyhow::Result<ControllerState> {
        let view = &mut self.stack.controller;
        let found = wait_for(what, PATIENCE / 4, || {
            view.latest_state().ok().flatten().filter(|state| is(state))
        });
        found.map_err(|timed_out| {
            let latest = self.stack.controller.latest_state().ok().flatten();
            let now = latest.map(|state| (state.state, state.fault, state.waiting));
            anyhow::anyhow!("{timed_out} {now:?}")
        })
    }
}

fn liars(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let mut stand = Stand::new(Misbehaviour::None);
    stand.stack.wait_until_ready()?;
    let listener = Listener::start(&stand.stack.world.options);
    let times = scale.pick(1, 5);
    let (mut driven_on, mut named, mut recovered, mut tried) = (Vec::new(), 0, 0, 0);
    let mut stray = Vec::new();
    for round in 0..times {
        for (misbehaviour, reason) in [
            (Misbehaviour::RepeatsState, Waiting::RepeatedRobotState),
            (
                Misbehaviour::StampOffset(-10_000_000_000),
                Waiting::RepeatedRobotState,
            ),
            (
                Misbehaviour::StampOffset(5_000_000_000),
                Waiting::FutureRobotState,
            ),
            (
                Misbehaviour::StampOffset(1_700_000_000_000_000_000),
                Waiting::FutureRobotState,
            ),
        ] {
            tried += 1;
            let shape = SHAPES[tried % 2];
            let id = stand.stack.begin_motion(Goal::Configuration(shape))?;
            let progress_s = 0.5 + 0.1 * f64::from(round);
            stand.stack.wait_for_progress(id, progress_s)?;
            drop(listener.take());
            thread::sleep(Duration::from_millis(50));
            let last_ns = stand.robot.sent().map_or(0, |state| state.stamp_mono_ns);
            stand.robot.misbehave(misbehaviour);
            let lost = stand.wait_for("the robot is lost", |state| {
                state.fault == LoopFault::RobotLost && state.state == LoopState::Fault
            });
            let lost = match lost {
                Ok(lost) => lost,
                Err(error) => {
                    stray.push(format!("{misbehaviour:?}: {error}"));
                    stand.robot.misbehave(Misbehaviour::None);
                    stand.stack.clear_fault()?;
                    continue;
                }
            };
            driven_on.push(driven_on_ms(&listener.take().cycles, last_ns));
            let told = stand.wait_for("the reason", |state| state.waiting == reason);
            let is_never_another = lost.waiting == reason || lost.waiting == Waiting::None;
            named += usize::from(is_never_another && told.is_ok());
            recovered += usize::from(recovers(&mut stand));
        }
    }
    report.none_of("defect 4: drivers that lie and are not lost", &stray);
    let most = driven_on.iter().copied().fold(0.0, f64::max);
    let name = "defect 4: cycle time driven on after the last true state, the longest, ms (robot_lost_ms and two cycles)";
    let passed = most <= *LOST_MS && driven_on.len() == tried;
    report.check(
        name,
        format!("{most:.3} of {} tries", driven_on.len()),
        &format!("<= {} each", *LOST_MS),
        passed,
    );
    report.all_of(
        "defect 4: states of liars named (repeated, from the future)",
        named,
        tried,
    );
    report.all_of(
        "defect 4: held again after new states and a reset",
        recovered,
        tried,
    );
    pauses(report, scale)
}

/// Cycle time, ms, between a state and the first cycle that brakes; a cycle counts as two periods at most.
fn driven_on_ms(cycles: &[Cycle], last_ns: i64) -> f64 {
    let mut driven = 0.0;
    for pair in cycles
        .windows(2)
        .filter(|pair| pair[1].stamp_mono_ns > last_ns)
    {
        if pair[1].state != LoopState::Executing.code() {
            return driven;
        }
        let elapsed_ns = pair[1].stamp_mono_ns - pair[0].stamp_mono_ns;
        driven += (elapsed_ns as f64 * 1e-6).min(2.0 * *PERIOD_MS);
    }
    f64::INFINITY
}

/// Tells the truth again; a robot that nobody commands comes to rest, and is then waited for by nothing but a reset.
fn recovers(stand: &mut Stand) -> bool {
    stand.robot.misbehave(Misbehaviour::None);
    let fresh = stand.wait_for("new states are heard", |state| {
        state.waiting == Waiting::NotTakenUp
    });
    let reset = stand.stack.controller.command(Command::ResetFault, PROMPT);
    let holds = stand.wait_for("it holds", |state| {
        state.state == LoopState::Holding && state.waiting == Waiting::None
    });
    fresh.is_ok() && reset.is_ok_and(|reply| reply.accepted) && holds.is_ok()
}

/// Pauses of everything at once are nobody's fault (decision 0004).
fn pauses(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let mut stack = Stack::running(&Settings::default())?;
    let mut faults = Vec::new();
    for (round, pause_ms) in [30, 100, 300, 60]
        .into_iter()
        .cycle()
        .take(scale.pick(4, 12))
        .enumerate()
    {
        let id = stack.begin_motion(Goal::Configuration(SHAPES[round % 2]))?;
        stack.wait_for_progress(id, 0.5)?;
        stack.pause(Duration::from_millis(pause_ms), || ());
        if stack.wait_for_end(id).is_err() {
            let state = stack.controller_state();
            faults.push(format!("{pause_ms} ms: {}, {}", state.state, state.fault));
            stack.clear_fault()?;
        }
    }
    report.none_of(
        "defect 4: pauses of all processes at once that end in a fault",
        &faults,
    );
    Ok(())
}

/// How far an accepted set-point is off the tendon lengths of every configuration, m.
const RESIDUAL_M: f64 = 1.1e-6;

/// What robots do, what a controller then waits for, and what its log says is allowed.
const REASONS: [(Misbehaviour, Waiting, &str); 6] = [
    (
        Misbehaviour::OffTendonMap(RESIDUAL_M),
        Waiting::OffTendonMap,
        "1e-6 m are allowed",
    ),
    (
        Misbehaviour::NeverRests(1e-6),
        Waiting::RobotMoves,
        "at 0 m/s, is allowed",
    ),
    (
        Misbehaviour::Deaf,
        Waiting::NotTakenUp,
        "200 ms are allowed",
    ),
    (
        Misbehaviour::OffReference(0.03),
        Waiting::OffReference,
        "0.025 rad are allowed",
    ),
    (
        Misbehaviour::StampOffset(-60_000_000),
        Waiting::OldRobotState,
        "20 ms of age are allowed",
    ),
    (
        Misbehaviour::StampOffset(60_000_000),
        Waiting::FutureRobotState,
        "1 ms ahead are allowed",
    ),
];

fn waiting(report: &mut Report) -> anyhow::Result<()> {
    let (mut named, mut logged, mut held) = (0, 0, 0);
    for (misbehaviour, reason, allowed) in REASONS {
        let mut stand = Stand::new(misbehaviour);
        let state = stand.wait_for("a reason to wait", |state| {
            state.waiting == reason && state.state == LoopState::Starting
        })?;
        let residual_m = state.values.accepted_residual_m;
        let has_figure = reason != Waiting::OffTendonMap || (residual_m - RESIDUAL_M).abs() < 1e-9;
        let is_told = state.values.reason.text().contains(allowed);
        named += usize::from(has_figure && is_told);
        let controller = stand.stack.process(Part::Controller);
        let told = wait_for("it is logged", PROMPT, || {
            let log = controller.log();
            let line = log.lines().find(|line| line.contains(reason.text()))?;
            line.contains(allowed).then_some(())
        });
        logged += usize::from(told.is_ok());
        stand.robot.misbehave(Misbehaviour::None);
        let holds = stand.wait_for("it holds", |state| state.state == LoopState::Holding);
        held += usize::from(holds.is_ok());
    }
    report.all_of(
        "defect 7: reasons to stay in `starting` that are published, with what is allowed, and the figure of a set-point off the map",
        named,
        REASONS.len(),
    );
    report.all_of(
        "defect 7: reasons that are logged, with what is allowed",
        logged,
        REASONS.len(),
    );
    report.all_of(
        "defect 7: held as soon as the driver is mended",
        held,
        REASONS.len(),
    );
    let mut stack = Stack::new(&Settings::default());
    stack.start(Part::Controller);
    let view = &mut stack.controller;
    let alone = wait_for("a state", PROMPT, || {
        let state = view.latest_state().ok().flatten()?;
        (state.waiting == Waiting::NoRobotState).then_some(())
    });
    let figure = alone.map_or_else(
        |error| error.to_string(),
        |()| Waiting::NoRobotState.to_string(),
    );
    let passed = figure == Waiting::NoRobotState.text();
    report.check(
        "defect 7: a controller without a robot",
        figure,
        "no robot state",
        passed,
    );
    Ok(())
}

fn tolerance(report: &mut Report) -> anyhow::Result<()> {
    let with = |tolerance_rad| Settings {
        daemon: vec![("path_tolerance_rad", Value::Float(tolerance_rad))],
        ..Settings::fast_robot()
    };
    let mut stack = Stack::new(&with(0.0));
    stack.start(Part::Daemon);
    let status = wait_for("it ends", PROMPT, || {
        let daemon = stack.process(Part::Daemon);
        (!daemon.is_running()).then(|| daemon.log())
    });
    let text = status.unwrap_or_else(|_| "it runs".to_owned());
    let passed = ["path_tolerance_rad", "planner-daemon.toml", "0.001", "0.1"]
        .iter()
        .all(|word| text.contains(word));
    let figure = text.lines().last().unwrap_or_default().to_owned();
    report.check(
        "defect 7: a daemon with path_tolerance_rad = 0",
        figure,
        "refused by name, with 0.001 to 0.1",
        passed,
    );

    // A robot ten times as fast does not keep to the least that is allowed: its motions end in a fault.
    let mut stack = Stack::running(&with(0.001))?;
    let (mut faults, mut cleared, mut others) = (0, 0, Vec::new());
    for round in 0..6 {
        let id = stack.begin_motion(Goal::Configuration(SHAPES[round % 2]))?;
        if stack.wait_for_end(id).is_ok() {
            continue;
        }
        let fault = stack.controller_state().fault;
        if fault != LoopFault::TrackingError {
            others.push(format!("round {round}: {fault}"));
            stack.clear_fault()?;
            continue;
        }
        faults += 1;
        let reset = stack.controller.command(Command::ResetFault, PROMPT)?;
        thread::sleep(Duration::from_millis(300));
        let state = stack.controller_state();
        let holds = state.state == LoopState::Holding && state.fault == LoopFault::None;
        cleared += usize::from(reset.accepted && holds);
    }
    report.all_of(
        "defect 7: tracking errors of the least path tolerance that a reset clears",
        cleared,
        faults,
    );
    report.none_of("defect 7: other faults meanwhile", &others);
    raw_tolerance(report)
}

/// A path tolerance that cannot be, sent to the controller by something else than our daemon: refused, and no fault.
fn raw_tolerance(report: &mut Report) -> anyhow::Result<()> {
    let mut stack = Stack::new(&Settings::default());
    let mut daemon = RawDaemon::connect(&stack.world.options, stack.world.robot.hash())?;
    stack.start(Part::Controller);
    stack.start(Part::Robot);
    let holds = |state: &ControllerState| state.state == LoopState::Holding;
    wait_for("the controller holds", PATIENCE, || {
        holds(&stack.controller_state()).then_some(())
    })?;
    let instance = stack.controller_state().values.instance;
    let (mut wrong, from) = (Vec::new(), [0.0; 6]);
    for (tolerance_rad, is_good) in [
        (0.0, false),
        (-0.0, false),
        (9e-4, false),
        (f64::NAN, false),
        (f64::INFINITY, false),
        (0.01, true),
    ] {
        let mut to = from;
        to[0] += 0.1;
        let id = daemon.send(instance, [from, to], 3.0, tolerance_rad);
        let known = wait_for("it is refused or begins", PROMPT, || {
            let state = stack.controller_state();
            let values = &state.values;
            let is_known = values.refused_trajectory_id == id || values.trajectory_id == id;
            is_known.then_some(state)
        })?;
        let is_refused = known.values.refused_trajectory_id == id
            && known.refusal == Refusal::Malformed
            && holds(&known);
        let log = stack.process(Part::Controller).log();
        let line = log.lines().find(|line| line.contains(&format!("id={id} ")));
        let is_named = line.is_some_and(|line| {
            line.contains("path_tolerance_rad is")
                && (line.contains("0.001") || !tolerance_rad.is_finite())
        });
        if is_good == is_refused || is_good == is_named {
            let refusal = known.refusal;
            wrong.push(format!(
                "{tolerance_rad}: {refusal}, {}: {line:?}",
                known.state
            ));
        }
        thread::sleep(Duration::from_millis(300));
        let fault = stack.controller_state().fault;
        if fault != LoopFault::None {
            wrong.push(format!("{tolerance_rad}: {fault}"));
        }
    }
    let name = "defect 7: path tolerances sent straight to the controller that are not refused by name, or a good one that is";
    report.none_of(name, &wrong);
    Ok(())
}
