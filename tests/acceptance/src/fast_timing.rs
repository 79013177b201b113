//! Time parameterization beside linear programs and Python's toppra, on random certified paths.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use anyhow::{Context, ensure};
use datasets::scenes::{Setting, draw_target};
use denoiser::{FastModel, Manifest};
use pcc_model::{Configuration, Robot, SECTIONS, UnitRobot};
use planning::{Goal, Models, MovingObstacles, Planner, Problem, Request, Sampler};
use rayon::prelude::*;
use serde_json::json;
use tests::knots::limit_use_at;
use tests::motion::raise;
use tests::programs::repository;
use trajectory::{ParameterizationOptions, TimeParameterizer, Trajectory};

use crate::paper_python::python_with;
use crate::report::Report;
use crate::runs::weights_folder;
use crate::scale::Scale;
use crate::second_look::{BODY, plain, plain_limits};
use crate::spread::median;
use crate::timer::Timer;

const SETTINGS: [Setting; 2] = [Setting::General(None), Setting::Hard];
/// Seed of scenes that nothing was trained or tuned on.
const SEED: u64 = 990_017;
/// The grid that both solvers are timed on.
const INTERVALS: usize = 252;
/// Ours, on which the durations are as accurate as toppra's on [`INTERVALS`].
const OUR_INTERVALS: usize = 400;
/// The grid that is taken for the truth.
const FINE_INTERVALS: usize = 2016;
/// Rate at which the executed curve is looked at.
const SAMPLES_PER_SECOND: f64 = 10_000.0;
/// Of both solvers for one time.
const REPETITIONS: usize = 20;

pub(crate) fn run(report: &mut Report, scale: Scale) {
    let command = "scripts/reference_timing.py";
    report.group("time parameterization", command, |report| {
        let cases = Cases::make(scale.pick(20, 200))?;
        let mut reference = cases.reference()?;
        report.shown("time parameterization: beside", reference.about.clone());
        report.shown(
            "time parameterization: paths, as many in general as in hard scenes",
            cases.left_out.text(cases.cases.len()),
        );
        optimal(report, &cases, &mut reference)?;
        within_limits(report, &cases);
        durations(report, &cases);
        speed(report, &cases, &mut reference)
    });
}

/// A certified path of 64 waypoints, and its motion.
struct Case {
    waypoints: Vec<Configuration>,
    motion: Trajectory,
    /// Duration before jerk is bounded, s.
    unbounded: f64,
    /// Path parameter, rad, and speed, rad/s, before jerk is bounded.
    speeds: Vec<(f64, f64)>,
}

struct Cases {
    robot: UnitRobot,
    cases: Vec<Case>,
    left_out: LeftOut,
}

/// What no path of the comparison came of, until there were enough.
#[derive(Default)]
struct LeftOut {
    /// Indices without a valid target.
    targets: usize,
    /// Requests without a plan.
    requests: usize,
    /// Draws that are not certified.
    uncertified: usize,
    /// Paths that certify only with rests at their corners: another motion, of several paths.
    with_rests: usize,
}

impl LeftOut {
    fn text(&self, kept: usize) -> String {
        let Self {
            targets,
            requests,
            uncertified,
            with_rests,
        } = self;
        format!(
            "{kept} kept; left out: {with_rests} certified only with rests at their corners, {uncertified} draws not certified, {requests} requests without a plan, {targets} indices without a target"
        )
    }
}

impl Cases {
    /// As many in general as in hard scenes: what the learned sampler and the tree find there, certified.
    fn make(count: usize) -> anyhow::Result<Self> {
        let file = repository().join("config/robots/unit.toml");
        let robot = Robot::from_file(&file)?;
        let robot = robot.to_unit().context("equal sections are needed")?;
        let manifest = Manifest::open(&weights_folder())?;
        let fast = FastModel::from_weights(&manifest.weights("fast")?, robot.bending_limit)?;
        let models = Models {
            fast: Some(fast),
            ..Models::default()
        };
        let planner = Planner::new(robot, models, 1)?;
        let mut made = Self {
            robot: planner.robot().clone(),
            cases: Vec::new(),
            left_out: LeftOut::default(),
        };
        for (setting, total) in SETTINGS.into_iter().zip([count / 2, count]) {
            for index in 0.. {
                made.add(&planner, setting, index, total)?;
                if made.cases.len() == total {
                    break;
                }
            }
        }
        Ok(made)
    }

    /// Adds the certified paths of one target, up to `total`.
    fn add(
        &mut self,
        planner: &Planner,
        setting: Setting,
        index: u64,
        total: usize,
    ) -> anyhow::Result<()> {
        let Some(target) = draw_target(&self.robot, setting, SEED, index) else {
            self.left_out.targets += 1;
            return Ok(());
        };
        let problem = Problem {
            start: target.starts[0],
            goal: Goal::Tip(target.tip),
            scene: target.scene,
            moving: MovingObstacles::default(),
        };
        let Ok(plan) = planner.plan(&problem, &request(index), &|| false) else {
            self.left_out.requests += 1;
            return Ok(());
        };
        for draw in plan.draws {
            if self.cases.len() == total {
                break;
            }
            let (Ok(certified), Some(waypoints)) = (draw.outcome, draw.path) else {
                self.left_out.uncertified += 1;
                continue;
            };
            let case = self.parameterize(waypoints)?;
            if case.motion == *certified.trajectory {
                self.cases.push(case);
            } else {
                self.left_out.with_rests += 1;
            }
        }
        Ok(())
    }

    fn parameterize(&self, waypoints: Vec<Configuration>) -> anyhow::Result<Case> {
        let (tendons, limits) = (&self.robot.tendons, &self.robot.tendon_limits);
        let options = ParameterizationOptions::default();
        let mut parameterizer = TimeParameterizer::default();
        let motion = parameterizer.parameterize(&waypoints, tendons, limits, &options)?;
        let unbounded = parameterizer.fastest_duration(&waypoints, tendons, limits, &options)?;
        let speeds = parameterizer.path_speeds().collect();
        Ok(Case {
            waypoints,
            motion,
            unbounded,
            speeds,
        })
    }

    /// The program that times the same paths, waiting for orders.
    fn reference(&self) -> anyhow::Result<Timer> {
        let file = repository().join("target/acceptance/fast/timing.json");
        self.write(&file)?;
        let python = python_with("venv-timing", "scripts/requirements-timing.txt", "toppra")?;
        let script = repository().join("scripts/reference_timing.py");
        Timer::start(Command::new(python).arg(script).arg(file))
    }

    fn write(&self, file: &PathBuf) -> anyhow::Result<()> {
        let rows = |points: &[Configuration]| -> Vec<Vec<f64>> {
            points.iter().map(|p| p.iter().copied().collect()).collect()
        };
        let paths = self.cases.iter().map(|case| {
            let (s, speed): (Vec<f64>, Vec<f64>) = case.speeds.iter().copied().unzip();
            json!({ "waypoints": rows(&case.waypoints), "s": s, "speed": speed })
        });
        let matrix = self.robot.tendons.matrix();
        let tendons: Vec<Vec<f64>> = matrix
            .row_iter()
            .map(|row| row.iter().copied().collect())
            .collect();
        let text = serde_json::to_string(&json!({
            "velocity": self.robot.tendon_limits.velocity,
            "acceleration": self.robot.tendon_limits.acceleration,
            "tendons": tendons,
            "spacing": ParameterizationOptions::default().spacing,
            "paths": paths.collect::<Vec<_>>(),
        }))?;
        let folder = file.parent().unwrap_or(Path::new("."));
        std::fs::create_dir_all(folder)?;
        std::fs::write(file, text).with_context(|| format!("{} not written", file.display()))
    }
}

/// Two candidates of `default`, at full limits.
fn request(seed: u64) -> Request {
    Request {
        candidates: 2,
        seed,
        sampler: Sampler::Default,
        limits_scale: 1.0,
        padding: [0.0; SECTIONS],
        knots: ParameterizationOptions::default().knots,
        corrections: planning::MOST_CORRECTIONS,
        start_motion: None,
        previous: None,
        end_to_move: None,
    }
}

/// Beside two other solvers on the same path and grid.
fn optimal(report: &mut Report, cases: &Cases, reference: &mut Timer) -> anyhow::Result<()> {
    let (mut program, mut toppra, mut active) = (Vec::new(), Vec::new(), Vec::new());
    for (i, case) in cases.cases.iter().enumerate() {
        let off = |duration: f64| (case.unbounded - duration).abs() / case.unbounded;
        program.push(off(reference.ask(&format!("lp {i}"))?));
        toppra.push(off(reference.ask(&format!("toppra {i}"))?));
        active.push(reference.ask(&format!("active {i}"))?);
    }
    let paths = format!("{} paths, same path and grid", cases.cases.len());
    for (name, differences) in [("the linear programs", &program), ("toppra", &toppra)] {
        let line = format!("time parameterization: |T − T of {name}| ÷ T, largest of {paths}");
        report.at_most(&line, largest(differences), 1e-3);
    }
    let least = active.iter().copied().fold(1.0, f64::min);
    report.check(
        "time parameterization: part of the time with a limit fully used, before jerk is bounded, least of all paths (median)",
        format!("{:.2} % ({:.2} %)", 100.0 * least, 100.0 * median(&active)),
        "> 97 %",
        least > 0.97,
    );
    Ok(())
}

/// The executed curve, by samples that share nothing with the time parameterization.
fn within_limits(report: &mut Report, cases: &Cases) {
    let limits = plain_limits(&cases.robot.tendon_limits);
    let used = |case: &Case| limit_use_at(&BODY, &plain(&case.motion), &limits, SAMPLES_PER_SECOND);
    let all: Vec<[f64; 3]> = cases.cases.par_iter().map(used).collect();
    let count = all.len();
    for (which, name) in ["v_max", "a_max", "j_max"].into_iter().enumerate() {
        let mut most = 0.0;
        for used in &all {
            raise(&mut most, used[which]);
        }
        let line = format!(
            "time parameterization: peak ÷ {name} at 10 kHz or more on the executed curves, all {count} over their whole duration"
        );
        report.at_most(&line, most, 1.0 + 1e-6);
    }
}

fn durations(report: &mut Report, cases: &Cases) {
    let limits = &cases.robot.tendon_limits;
    let width = 2.0 * limits.acceleration / limits.jerk;
    let over = |duration: &dyn Fn(&Case) -> f64| -> Vec<f64> {
        let share = |case| 100.0 * (duration(case) / case.unbounded - 1.0);
        cases.cases.iter().map(share).collect()
    };
    for (name, costs) in [
        ("as executed", over(&|case| case.motion.duration())),
        (
            "with a moving average of 2a/j",
            over(&|case| case.unbounded + width),
        ),
    ] {
        let figure = format!("{:.2} %, {:.2} %", median(&costs), quantile(&costs, 0.95));
        let line = format!("time parameterization: cost of bounding jerk {name}, median and p95");
        report.shown(&line, figure);
    }
    let mean = |duration: &dyn Fn(&Case) -> f64| {
        let sum: f64 = cases.cases.iter().map(duration).sum();
        sum / cases.cases.len() as f64
    };
    report.shown(
        "time parameterization: mean duration as executed, and before jerk is bounded",
        format!(
            "{:.2} s, {:.2} s",
            mean(&|case| case.motion.duration()),
            mean(&|case| case.unbounded)
        ),
    );
    let steps = |case: &Case| full_speed_steps(&cases.robot, &case.waypoints);
    let equal = |case: &Case| largest(&steps(case)) * steps(case).len() as f64;
    report.shown(
        "time parameterization: mean duration by the velocity-only rule (it starts and stops at once), each step at its \
         full speed, and equal steps",
        format!("{:.2} s, {:.2} s", mean(&|case| steps(case).iter().sum()), mean(&equal)),
    );
}

/// What each step between waypoints takes if its longest tendon change is at full speed, s.
fn full_speed_steps(robot: &Robot, waypoints: &[Configuration]) -> Vec<f64> {
    let mut lengths = vec![0.0; robot.tendons.count()];
    let steps = waypoints.windows(2).map(|pair| {
        robot.tendons.lengths(&(pair[1] - pair[0]), &mut lengths);
        let longest = lengths.iter().fold(0.0f64, |most, l| most.max(l.abs()));
        longest / robot.tendon_limits.velocity
    });
    steps.collect()
}

/// TOPP-RA beside TOPP-RA, in turns and on the same paths, both on one thread, each the median of as many in a row after one that is not
/// counted; then the whole time parameterization.
fn speed(report: &mut Report, cases: &Cases, reference: &mut Timer) -> anyhow::Result<()> {
    let mut parameterizer = TimeParameterizer::default();
    let (tendons, limits) = (&cases.robot.tendons, &cases.robot.tendon_limits);
    let default = ParameterizationOptions::default();
    let on = |grid_intervals| ParameterizationOptions {
        grid_intervals,
        ..default
    };
    let (alike, as_accurate) = (on(INTERVALS), on(OUR_INTERVALS));
    let mut times = Times::default();
    for (i, case) in cases.cases.iter().enumerate() {
        let mut ours = |options: &ParameterizationOptions| {
            let mut duration = 0.0;
            let seconds = seconds(|| {
                duration =
                    parameterizer.fastest_duration(&case.waypoints, tendons, limits, options)?;
                Ok(())
            })?;
            Ok::<_, anyhow::Error>((seconds, duration))
        };
        times
            .solver
            .push(reference.ask(&format!("seconds {i} {INTERVALS}"))?);
        times
            .theirs
            .push(reference.ask(&format!("whole {i} {INTERVALS}"))?);
        times.nodes.push(reference.ask(&format!("nodes {i}"))?);
        times.alike.push(ours(&alike)?.0);
        let (seconds_as_accurate, duration) = ours(&as_accurate)?;
        times.as_accurate.push(seconds_as_accurate);
        times.whole.push(seconds(|| {
            parameterizer.parameterize(&case.waypoints, tendons, limits, &default)?;
            Ok(())
        })?);
        let truth = reference.ask(&format!("duration {i} {FINE_INTERVALS}"))?;
        let their_duration = reference.ask(&format!("duration {i} {INTERVALS}"))?;
        times.our_error.push((duration / truth - 1.0).abs());
        times.their_error.push((their_duration / truth - 1.0).abs());
    }
    ensure!(!times.alike.is_empty(), "no paths");
    times.show(report);
    Ok(())
}

/// Of each path, s, and the relative errors of its duration.
#[derive(Default)]
struct Times {
    /// toppra, spline and projection not counted.
    solver: Vec<f64>,
    /// toppra, from the spline's nodes to the duration.
    theirs: Vec<f64>,
    /// The script's own loop that makes these nodes of the waypoints, which is not toppra's.
    nodes: Vec<f64>,
    /// Ours, from waypoints to the duration, on as many intervals.
    alike: Vec<f64>,
    /// Ours, from waypoints to the duration, where we are as accurate.
    as_accurate: Vec<f64>,
    /// Ours, from waypoints to the motion that is executed.
    whole: Vec<f64>,
    our_error: Vec<f64>,
    their_error: Vec<f64>,
}

impl Times {
    fn show(&self, report: &mut Report) {
        self.check_ratios(report);
        report.shown(
            "time parameterization: the script's own making of nodes for toppra, which is not counted, median",
            format!("{:.2} ms", 1e3 * median(&self.nodes)),
        );
        let (ours, theirs) = (median(&self.our_error), median(&self.their_error));
        report.check(
            "time parameterization: error of these durations against 2016 intervals, medians, ours and toppra's",
            format!("{ours:.2e}, {theirs:.2e}"),
            "ours <= toppra's",
            ours <= theirs,
        );
        report.shown(
            "time parameterization: from waypoints to the executed motion, median and p95",
            format!(
                "{:.1} µs, {:.1} µs",
                1e6 * median(&self.whole),
                1e6 * quantile(&self.whole, 0.95)
            ),
        );
    }

    /// Checks that toppra takes many times as long, on as many intervals and where both are as accurate.
    fn check_ratios(&self, report: &mut Report) {
        let paths = self.alike.len();
        for (ours, on, theirs, what) in [
            (
                &self.alike,
                "on as many",
                &self.theirs,
                "both with spline and projection, and ours from the waypoints",
            ),
            (
                &self.as_accurate,
                "where we are as accurate",
                &self.theirs,
                "both with spline and projection, and ours from the waypoints",
            ),
            (
                &self.as_accurate,
                "where we are as accurate",
                &self.solver,
                "its spline and projection not counted and ours counted",
            ),
        ] {
            let (times, figure) = ratio(theirs, ours);
            let line = format!(
                "time parameterization: toppra's time on {INTERVALS} intervals ÷ ours {on}, {what}, medians of {paths} paths"
            );
            report.check(&line, figure, ">= 50 ×", times >= 50.0);
        }
    }
}

/// The median of their times ÷ the median of ours, and how that is shown.
fn ratio(theirs: &[f64], ours: &[f64]) -> (f64, String) {
    let (theirs, ours) = (median(theirs), median(ours));
    let (ms, us) = (1e3 * theirs, 1e6 * ours);
    (
        theirs / ours,
        format!("{:.0} × ({ms:.2} ms and {us:.1} µs)", theirs / ours),
    )
}

/// Median of [`REPETITIONS`] in a row, after one that is not counted.
fn seconds(mut work: impl FnMut() -> anyhow::Result<()>) -> anyhow::Result<f64> {
    work()?;
    let mut times = Vec::with_capacity(REPETITIONS);
    for _ in 0..REPETITIONS {
        let began = Instant::now();
        work()?;
        times.push(began.elapsed().as_secs_f64());
    }
    Ok(median(&times))
}

fn largest(values: &[f64]) -> f64 {
    values.iter().copied().fold(0.0, f64::max)
}

fn quantile(values: &[f64], part: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[((sorted.len() - 1) as f64 * part).round() as usize]
}
