//! Stops and speed orders at random instants on the three processes, at every rate and with late cycles, from what the controller
//! publishes of each cycle.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use pcc_model::{Configuration, Robot};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use realtime::use_fifo_priority;
use rustix::process::{Pid, Signal, kill_process};
use shared_types::codes::{LoopFault, LoopState};
use shared_types::message::Cycle;
use shared_types::valid::{Command, Goal};
use tests::listener::Listener;
use tests::motion::{LimitsKept, TendonSample};
use tests::priority::OF_A_WATCH;
use tests::stack::{Part, Stack};
use tests::world::{Settings, World};
use toml::{Table, Value};
use trajectory::Trajectory;

use crate::report::Report;
use crate::safe::on_path::{Along, Nearest};
use crate::scale::Scale;

/// Rates of the loop, Hz: the periods of the simulated stops.
const RATES_HZ: [i64; 4] = [4000, 1000, 400, 100];
/// Two shapes to go to and fro between, rad.
const SHAPES: [[f64; 6]; 2] = [
    [0.9, -0.6, 0.5, 0.7, -0.7, 0.9],
    [-0.8, 0.7, -0.6, -0.5, 0.8, -0.7],
];
const PROMPT: Duration = Duration::from_secs(5);
/// The longest that a cycle may be made, ms: the robot bears 20 ms without a set-point, and who holds the loop comes late, too.
const LONGEST_MS: f64 = 18.0;
/// Changes of speed before each stop.
const SPEEDS: usize = 8;
/// Longest time between two orders, ms. All of a stop's orders come while the shortest of these motions is under way.
const BETWEEN_MS: u64 = 120;

pub(super) fn run(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let mut given = 0;
    for rate_hz in RATES_HZ {
        given += at_rate(report, rate_hz, scale.pick(5, 100))?;
    }
    let bar = scale.pick(100, 3_000);
    let name = "defect 1, live: stops and speed orders given";
    report.check(name, given.to_string(), &format!(">= {bar}"), given >= bar);
    Ok(())
}

/// What was ordered and what came of it.
#[derive(Debug, Default)]
struct Orders {
    given: usize,
    obeyed: usize,
    /// Faults, and orders that were refused.
    wrong: Vec<String>,
}

impl Orders {
    /// Gives an order to a robot in motion, and counts whether it is obeyed.
    fn give(&mut self, stack: &mut Stack, command: Command) -> anyhow::Result<()> {
        let is_obeyed = self.at_rest(stack, command)?;
        self.given += 1;
        self.obeyed += usize::from(is_obeyed);
        Ok(())
    }

    /// Gives an order to a robot at rest, which counts only where it is refused. Returns whether it is obeyed.
    fn at_rest(&mut self, stack: &mut Stack, command: Command) -> anyhow::Result<bool> {
        let reply = stack.controller.command(command, PROMPT)?;
        if !reply.accepted {
            let (reason, state) = (reply.reason, reply.state);
            self.wrong.push(format!("{command:?}: {reason}, {state}"));
        }
        Ok(reply.accepted)
    }
}

/// Orders on `stops` motions at one rate; how many.
fn at_rate(report: &mut Report, rate_hz: i64, stops: usize) -> anyhow::Result<usize> {
    let mut stack = stack_at(rate_hz)?;
    let listener = Listener::start(&stack.world.options);
    let period_ms = 1e3 / rate_hz as f64;
    let mut random = Pcg64::seed_from_u64(rate_hz.unsigned_abs());
    let controller = stack.process(Part::Controller).pid();
    let holder = Holder::start(controller, LONGEST_MS - period_ms, random.random());
    let mut orders = Orders::default();
    let (mut cycles, mut paths) = (Vec::new(), BTreeMap::new());
    for round in 0..stops {
        let (id, path) = one_stop(&mut stack, round, &mut random, &mut orders)?;
        paths.insert(id, path);
        cycles.extend(listener.take().cycles);
    }
    let holds = holder.end();
    thread::sleep(Duration::from_millis(100));
    cycles.extend(listener.take().cycles);
    let name = format!("defect 1, live at {rate_hz} Hz");
    report.all_of(
        &format!("{name}: stops and speed orders obeyed"),
        orders.obeyed,
        orders.given,
    );
    let of = format!("{name}: faults of {stops} stopped motions, and orders refused");
    report.none_of(&of, &orders.wrong);
    let motions: Vec<Trajectory> = paths.values().cloned().collect();
    super::have_jerk_steps(report, &name, &stack.world.robot, &motions);
    let (off_path_rad, place) = farthest_off_path(&stack.world.robot, &cycles, &paths);
    let of = format!("{name}: distance of what was sent from the path, rad");
    report.at_most(&of, off_path_rad, super::ON_PATH_RAD);
    report.shown(&format!("{name}: the farthest"), place);
    Judged::of(&cycles, &stack, rate_hz).tell(report, &name, holds);
    Ok(orders.given)
}

fn stack_at(rate_hz: i64) -> anyhow::Result<Stack> {
    let world = World::new(&Settings::default());
    let file = world.config("controller.toml");
    let mut table: Table = std::fs::read_to_string(&file)?.parse()?;
    table.insert("rate_hz".into(), Value::Integer(rate_hz));
    std::fs::write(&file, table.to_string())?;
    let mut stack = Stack::within(world);
    Part::ALL.into_iter().for_each(|part| stack.start(part));
    stack.wait_until_ready()?;
    Ok(stack)
}

/// A motion to the shape that is farther away, changes of its speed, and a stop; the next one begins from there.
fn one_stop(
    stack: &mut Stack,
    round: usize,
    random: &mut Pcg64,
    orders: &mut Orders,
) -> anyhow::Result<(u32, Trajectory)> {
    let now = stack.commanded();
    let distance = |shape: &[f64; 6]| (now - Configuration::from(*shape)).norm();
    let is_second = distance(&SHAPES[1]) > distance(&SHAPES[0]);
    let goal = Goal::Configuration(SHAPES[usize::from(is_second)]);
    let (id, path) = stack.begin_known_motion(goal)?;
    if let Err(error) = stack.wait_for_progress(id, 0.0) {
        let what = format!("round {round}: not under way: {}", error.what);
        orders.wrong.push(what);
        stack.clear_fault()?;
        return Ok((id, path));
    }
    for _ in 0..SPEEDS {
        thread::sleep(Duration::from_millis(random.random_range(0..BETWEEN_MS)));
        let speed = match random.random_range(0..4) {
            0 => 0.0,
            1 => 1.0,
            _ => random.random_range(0.0..1.0),
        };
        orders.give(stack, Command::SetSpeed(speed))?;
    }
    thread::sleep(Duration::from_millis(random.random_range(0..BETWEEN_MS)));
    orders.give(stack, Command::Stop)?;
    let ended = stack.wait_for_end(id);
    let state = stack.controller_state();
    if ended.is_err() || state.fault != LoopFault::None {
        let what = format!("round {round}: {}, {}", state.state, state.fault);
        orders.wrong.push(what);
        stack.clear_fault()?;
    }
    orders.at_rest(stack, Command::SetSpeed(1.0))?;
    Ok((id, path))
}

/// The largest distance of any cycle in motion from its trajectory, rad, and where that is; infinite where one follows a trajectory that
/// nobody planned, or where none moves.
fn farthest_off_path(
    robot: &Robot,
    cycles: &[Cycle],
    paths: &BTreeMap<u32, Trajectory>,
) -> (f64, String) {
    let moving = [LoopState::Executing, LoopState::Stopping].map(LoopState::code);
    let moving = cycles.iter().filter(|cycle| moving.contains(&cycle.state));
    let mut along = BTreeMap::new();
    let mut farthest: Option<(f64, String)> = None;
    for cycle in moving {
        let id = cycle.trajectory_id;
        let Some(path) = paths.get(&id) else {
            return (f64::INFINITY, format!("trajectory {id} was not planned"));
        };
        let along = along.entry(id).or_insert_with(|| Along::new(robot, path));
        let Nearest {
            time_s,
            distance_rad,
        } = along.nearest(cycle);
        let is_farther = |(most_rad, _): &(f64, String)| distance_rad > *most_rad;
        if distance_rad.is_nan() || farthest.as_ref().is_none_or(is_farther) {
            let (of_s, state) = (path.duration(), cycle.state);
            let place = format!("trajectory {id} at {time_s:.4} of {of_s:.4} s, state {state}");
            farthest = Some((distance_rad, place));
        }
    }
    farthest.unwrap_or_else(|| (f64::INFINITY, "nothing moved".to_owned()))
}

/// Stops a process now and then for so long that the loop's next cycle comes late; ends when told or dropped.
struct Holder {
    quit: Arc<AtomicBool>,
    thread: Option<JoinHandle<usize>>,
}

impl Holder {
    fn start(pid: u32, longest_ms: f64, seed: u64) -> Self {
        let quit = Arc::<AtomicBool>::default();
        let stop = Arc::clone(&quit);
        let thread = thread::spawn(move || {
            // Who comes late to let it go makes it later than was meant.
            let _ = use_fifo_priority(OF_A_WATCH);
            let pid = Pid::from_raw(pid.cast_signed()).expect("a process");
            let (mut random, mut holds) = (Pcg64::seed_from_u64(seed), 0);
            while !stop.load(Ordering::Relaxed) {
                thread::sleep(Duration::from_millis(random.random_range(10..100)));
                let _ = kill_process(pid, Signal::STOP);
                let ms = random.random_range(0.1..longest_ms);
                thread::sleep(Duration::from_secs_f64(ms * 1e-3));
                let _ = kill_process(pid, Signal::CONT);
                holds += 1;
            }
            holds
        });
        Self {
            quit,
            thread: Some(thread),
        }
    }

    /// How often it was stopped.
    fn end(mut self) -> usize {
        self.join()
    }

    fn join(&mut self) -> usize {
        self.quit.store(true, Ordering::Relaxed);
        let ended = self.thread.take().map(JoinHandle::join);
        ended.map_or(0, |holds| holds.expect("holding does not panic"))
    }
}

impl Drop for Holder {
    fn drop(&mut self) {
        self.join();
    }
}

/// All that was published from the first cycle that held the robot on.
#[derive(Debug, Default)]
struct Judged {
    kept: LimitsKept,
    cycles: usize,
    /// Cycles that came more than 1.1 periods after the one before.
    late: usize,
    /// The longest time between two cycles, ms.
    longest_ms: f64,
    unheard: u64,
    let_go: Vec<String>,
}

impl Judged {
    fn of(cycles: &[Cycle], stack: &Stack, rate_hz: i64) -> Self {
        let held = [
            LoopState::Holding,
            LoopState::Executing,
            LoopState::Stopping,
        ];
        let is_held = |cycle: &Cycle| held.iter().any(|state| state.code() == cycle.state);
        let first = cycles.iter().position(is_held).unwrap_or(cycles.len());
        let limits = &stack.world.robot.tendon_limits;
        let mut judged = Self::default();
        for pair in cycles[first..].windows(2) {
            let (before, after) = (sample(&pair[0]), sample(&pair[1]));
            judged.cycles += 1;
            judged.kept.add(&after, limits);
            let missing = pair[1].sequence - pair[0].sequence - 1;
            judged.unheard += missing;
            if missing == 0 {
                judged.kept.add_neighbours(&before, &after, limits);
            } else {
                judged.kept.add_step(&before, &after, limits);
            }
            let elapsed_ms = (after.stamp_ns - before.stamp_ns) as f64 * 1e-6;
            judged.longest_ms = judged.longest_ms.max(elapsed_ms);
            judged.late += usize::from(elapsed_ms * rate_hz as f64 > 1.1e3);
            if is_held(&pair[0]) && !is_held(&pair[1]) {
                let what = format!("cycle {}, {elapsed_ms:.1} ms long", pair[1].sequence);
                judged.let_go.push(what);
            }
        }
        judged
    }

    fn tell(&self, report: &mut Report, name: &str, holds: usize) {
        let kept = &self.kept;
        report.check(
            &format!("{name}: cycles recorded, late ones among them"),
            format!(
                "{}, {} late, {holds} times held, the longest {:.1} ms",
                self.cycles, self.late, self.longest_ms
            ),
            "as many late ones as a tenth of the holds",
            holds > 0 && 10 * self.late >= holds,
        );
        report.none_of(&format!("{name}: robots let go"), &self.let_go);
        let unheard = self.unheard as f64;
        report.at_most(&format!("{name}: cycles not heard"), unheard, 0.0);
        for (what, figure, bar) in [
            ("velocity sent ÷ limit", kept.velocity, super::ROUNDING),
            (
                "acceleration sent ÷ limit",
                kept.acceleration,
                super::ROUNDING,
            ),
            (
                "step ÷ time ÷ velocity limit",
                kept.difference_velocity,
                super::ROUNDING,
            ),
            (
                "velocity step ÷ time ÷ acceleration limit",
                kept.difference_acceleration,
                1.0 + 1e-4,
            ),
            (
                "step unexplained by its velocities ÷ a Δt²",
                kept.unexplained_step,
                0.25 + 1e-3,
            ),
        ] {
            report.at_most(&format!("{name}: {what}"), figure, bar);
        }
    }
}

fn sample(cycle: &Cycle) -> TendonSample {
    TendonSample {
        stamp_ns: cycle.stamp_mono_ns,
        position: cycle.setpoint_m,
        velocity: cycle.setpoint_velocity_m_s,
        acceleration: cycle.setpoint_acceleration_m_s2,
    }
}
