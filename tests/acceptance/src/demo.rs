//! The demonstration on a clean clone, judged from its recording.

use std::collections::BTreeSet;
use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, ensure};
use pcc_model::{Configuration, Point, Robot};
use tests::brute_force::Body;
use tests::programs::repository;
use tests::recording::{RecordedMotion, Recording, ToldMotion};

use crate::report::Report;
use crate::scale::Scale;

/// How the result of a motion begins, as the project's docs say.
const OUTCOMES: [&str; 5] = ["reached", "joined by", "stopped", "set aside", "refused"];

pub(crate) fn run(report: &mut Report, scale: Scale) {
    let command = "git clone; scripts/demo --record DIR";
    report.group("demonstration", command, |report| {
        let folder = tempfile::tempdir()?;
        let recorded = folder.path().join("recording");
        let printed = on_a_clean_clone(report, scale, folder.path(), &recorded, &[])?;
        judge(report, &recorded, &printed)
    });
}

/// What it prints, with these arguments before `--record`.
pub(crate) fn on_a_clean_clone(
    report: &mut Report,
    scale: Scale,
    folder: &Path,
    recorded: &Path,
    arguments: &[&str],
) -> anyhow::Result<String> {
    let clone = clone_to_build(folder, scale)?;
    let mut demo = Command::new(clone.join("scripts/demo"));
    demo.current_dir(&clone)
        .args(arguments)
        .arg("--record")
        .arg(recorded);
    demo.env_remove("CARGO_TARGET_DIR")
        .env_remove("RUST_BACKTRACE")
        .env("NO_COLOR", "1");
    let output = demo.output()?;
    let error = String::from_utf8_lossy(&output.stderr);
    let mut figure = output.status.to_string();
    if !output.status.success() {
        eprintln!("{}{error}", String::from_utf8_lossy(&output.stdout));
        let last = error.lines().rev().take(2).collect::<Vec<_>>().join(" | ");
        figure = format!("{figure}: {last}");
    }
    report.check(
        "scripts/demo on a clean clone",
        figure,
        "exit status: 0",
        output.status.success(),
    );
    ensure!(
        recorded.join("recording.npz").is_file(),
        "no recording: {}",
        String::from_utf8_lossy(&output.stderr)
    );
    Ok(String::from_utf8(output.stdout)?)
}

/// Clones the last commit into `folder`, to be built from nothing; the quick form keeps a clone and what is built of it from run to run elsewhere.
/// Returns where the clone is.
pub(crate) fn clone_to_build(folder: &Path, scale: Scale) -> anyhow::Result<PathBuf> {
    if scale.full {
        let clone = folder.join("clone");
        clean_clone(&clone)?;
        return Ok(clone);
    }
    let kept = repository().join("target/acceptance");
    let (clone, built) = (kept.join("clone"), kept.join("clone-target"));
    clean_clone(&clone)?;
    fs::create_dir_all(&built)?;
    symlink(built, clone.join("target"))?;
    Ok(clone)
}

/// The last commit, in a folder of its own.
pub(crate) fn clean_clone(folder: &Path) -> anyhow::Result<()> {
    if folder.exists() {
        fs::remove_dir_all(folder)?;
    }
    let status = Command::new("git")
        .args(["clone", "--quiet"])
        .args([repository().as_path(), folder])
        .status()?;
    ensure!(status.success(), "git clone: {status}");
    Ok(())
}

/// Judges a recording and what was printed beside it.
pub(crate) fn judge(report: &mut Report, folder: &Path, printed: &str) -> anyhow::Result<()> {
    let recording = Recording::read(folder)?;
    results(report, &recording, printed);
    let robot = Robot::from_file(&repository().join("config/robots/unit.toml"))?;
    let stated = recording.robot == robot.name && recording.limits == robot.tendon_limits;
    let figure = format!("{}, {:?}", recording.robot, recording.limits);
    report.check(
        "recording states robot and limits",
        figure,
        "the robot file's",
        stated,
    );
    let file = fs::read_to_string(repository().join("config/robots/unit.toml"))?;
    let body = Body::from_robot_file(&file);
    limits(report, &recording, &body);
    orders(report, &recording);
    whole_clearance(report, &recording, &body);
    let motions = recording.motions();
    let told = &recording.told.motions;
    let interrupted = &recording.told.interrupted;
    report.check(
        "motions that a stall cut short and that were asked for again",
        interrupted.len().to_string(),
        "0",
        interrupted.is_empty(),
    );
    let figure = format!("{} of {}", recording.mirrored(), recording.len());
    report.check(
        "samples without a hold of the robot, from the first motion on",
        figure,
        "0",
        recording.mirrored() == 0,
    );
    let figure = format!("{} recorded, {} told", motions.len(), told.len());
    report.check(
        "motions",
        figure,
        "as many recorded as told",
        motions.len() == told.len(),
    );
    ensure!(
        motions.len() == told.len(),
        "the recording and demo.json disagree"
    );
    for (motion, told) in motions.iter().zip(told) {
        one_motion(report, &recording, (&robot, &body), motion, told);
    }
    two_shapes(report, &motions, told)?;
    followed(report, &recording, (&robot, &body))?;
    let outcome = recording
        .told
        .impossible_outcome
        .as_deref()
        .unwrap_or("none");
    report.check(
        "experiment 3 as printed",
        outcome.to_owned(),
        "start in collision",
        outcome == "start in collision",
    );
    Ok(())
}

/// Every trajectory that was executed has a result in what was printed.
fn results(report: &mut Report, recording: &Recording, printed: &str) {
    let told: BTreeSet<u32> = printed.lines().flat_map(ids_of_results).collect();
    let executed = recording.executed();
    let untold: Vec<&u32> = executed.difference(&told).collect();
    report.check(
        "trajectories executed whose result was not printed",
        format!("{} of {} {untold:?}", untold.len(), executed.len()),
        "0, of > 20",
        untold.is_empty() && executed.len() > 20,
    );
}

/// The trajectories whose result a line tells: `trajectory 7 reached …`, or `trajectories 8 to 11, 13: each joined by the next one`.
fn ids_of_results(line: &str) -> Vec<u32> {
    let line = line.trim_start();
    if let Some(joined) = line.strip_prefix("trajectories ") {
        let Some((ranges, _)) = joined.split_once(": each joined") else {
            return Vec::new();
        };
        let range = |range: &str| {
            let (first, last) = range.split_once(" to ").unwrap_or((range, range));
            let ends = first.parse::<u32>().ok().zip(last.parse::<u32>().ok());
            ends.map_or(0..0, |(first, last)| first..last + 1)
        };
        return ranges.split(", ").flat_map(range).collect();
    }
    let one = line.strip_prefix("trajectory ").and_then(|rest| {
        let (id, outcome) = rest.split_once(' ')?;
        let is_result = OUTCOMES.iter().any(|it| outcome.starts_with(it));
        id.parse().ok().filter(|_| is_result)
    });
    one.into_iter().collect()
}

/// Stops and changes of speed are in what is judged.
fn orders(report: &mut Report, recording: &Recording) {
    let orders = &recording.told.orders;
    let stops = || orders.iter().filter(|order| order.order == "stop");
    let stopping: Vec<usize> = stops()
        .map(|order| recording.stopping(order.trajectory_id))
        .collect();
    report.check(
        "set-points of ordered stops in the recording",
        format!("{stopping:?}"),
        ">= 20 of each, and one at least",
        !stopping.is_empty() && stopping.iter().all(|setpoints| *setpoints >= 20),
    );
    let speeds = orders.iter().filter(|order| order.order == "speed");
    let longer: Vec<f64> = speeds
        .map(|order| recording.lasted_s(order.trajectory_id) / order.planned_s)
        .collect();
    report.check(
        "motions with ordered changes of speed in the recording: time ÷ planned time",
        format!("{longer:.3?}"),
        ">= 1.1 each, and two changes at least",
        longer.len() >= 2 && longer.iter().all(|longer| *longer >= 1.1),
    );
}

/// Of every motion, also of those that were stopped or cut short.
fn whole_clearance(report: &mut Report, recording: &Recording, body: &Body) {
    let whole = recording.clearance(body, (0, recording.len() - 1));
    report.check(
        "least clearance of everything that was executed, by dense sampling, m",
        format!("{:.4}, at most {:.1e} less", whole.sampled_m, whole.error_m),
        ">= 0, with a ball there",
        whole.sampled_m.is_finite() && whole.at_least_m() >= 0.0,
    );
    let told = recording.told.motions.iter();
    let around = told.filter(|told| told.minimum_clearance_m.is_some());
    let around = around.count();
    report.check(
        "motions told to have gone around something",
        around.to_string(),
        ">= 1",
        around > 0,
    );
}

fn limits(report: &mut Report, recording: &Recording, body: &Body) {
    let kept = recording.limits_kept();
    let samples = recording.len();
    report.check(
        "samples recorded",
        samples.to_string(),
        ">= 10000",
        samples >= 10_000,
    );
    report.at_most(
        "recorded tendon velocity over its limit, every sample",
        kept.velocity,
        1.0 + 1e-6,
    );
    report.at_most(
        "recorded tendon acceleration over its limit, every sample",
        kept.acceleration,
        1.0 + 1e-6,
    );
    report.at_most(
        "position differences ÷ time over the velocity limit",
        kept.difference_velocity,
        1.0 + 1e-6,
    );
    report.at_most(
        "velocity differences ÷ time over the acceleration limit",
        kept.difference_acceleration,
        1.0 + 1e-4,
    );
    report.at_most(
        "step unexplained by the velocities at its ends, over a Δt² (smooth: 1/4)",
        kept.unexplained_step,
        0.25 + 1e-3,
    );
    report.at_most(
        "set-points against the commanded configurations' tendons, m",
        recording.tendon_map_error(body),
        1e-9,
    );
    report.at_most(
        "part of the set-points that no configuration explains, m",
        recording.unexplained_m(body),
        1e-9,
    );
}

fn one_motion(
    report: &mut Report,
    recording: &Recording,
    (robot, body): (&Robot, &Body),
    motion: &RecordedMotion,
    told: &ToldMotion,
) {
    let name = |what: &str| format!("experiment {}, {}: {what}", told.experiment, told.name);
    let error = |configuration: Configuration| {
        let error_m = body.tip_error(&configuration.into(), &told.requested_tip_m);
        error_m / robot.section_lengths[0]
    };
    let what = format!(
        "tip asked {:.3?}, reached {:.4?}, error in section lengths",
        told.requested_tip_m,
        body.tip(&motion.end.into())
    );
    report.at_most(&name(&what), error(motion.end), 0.01);
    let measured = error(motion.measured_end);
    report.at_most(&name("tip error as measured"), measured, 0.03);
    let seconds = (recording.samples[motion.range.1].stamp_ns
        - recording.samples[motion.range.0].stamp_ns) as f64
        * 1e-9;
    let agrees = (seconds - told.duration_s).abs() < 0.1;
    report.check(
        &name("duration, s"),
        format!("{seconds:.2}"),
        &format!("told: {:.2}", told.duration_s),
        agrees,
    );
    let found = recording.clearance(body, motion.range);
    let agrees = match told.minimum_clearance_m {
        Some(told) => {
            found.sampled_m.is_finite() && (told - found.sampled_m).abs() < 0.01 && told >= 0.0
        }
        // Nothing was told to be in the way: nothing may have been there.
        None => found.sampled_m == f64::INFINITY,
    };
    let told_text = told
        .minimum_clearance_m
        .map_or("no obstacle".to_owned(), |c| format!("{c:.4}"));
    report.check(
        &name("least clearance of the executed motion, by dense sampling, m"),
        format!("{:.4}, at most {:.1e} less", found.sampled_m, found.error_m),
        &format!(">= 0, told: {told_text}"),
        found.at_least_m() >= 0.0 && agrees,
    );
    let figure = format!(
        "{:.2e} m, {} late cycles",
        told.largest_setpoint_step_m, told.late_cycles
    );
    let bar = robot.tendon_limits.velocity * 0.02 * 1.001;
    report.check(
        &name("largest set-point step and late cycles"),
        figure,
        &format!("<= {bar:.2e} m (20 ms at full speed)"),
        told.largest_setpoint_step_m <= bar,
    );
}

/// The two solutions of experiment 2.
fn two_shapes(
    report: &mut Report,
    motions: &[RecordedMotion],
    told: &[ToldMotion],
) -> anyhow::Result<()> {
    let ends: Vec<_> = motions
        .iter()
        .zip(told)
        .filter(|(_, told)| told.experiment == 2 && told.name.contains("solution"))
        .map(|(motion, _)| motion.end)
        .collect();
    let [first, second] = ends[..] else {
        anyhow::bail!("experiment 2 has {} motions to its target", ends.len());
    };
    let apart = (first - second).norm();
    report.check(
        "experiment 2: terminal shapes apart, rad",
        format!("{apart:.3}"),
        ">= 0.5",
        apart >= 0.5,
    );
    Ok(())
}

/// The target that moves, and the ball that crosses its way.
fn followed(
    report: &mut Report,
    recording: &Recording,
    (robot, body): (&Robot, &Body),
) -> anyhow::Result<()> {
    let name = |what: &str| format!("experiment 4: {what}");
    let told = recording.told.followed.as_ref();
    let told = told.context("demo.json tells nothing of experiment 4")?;
    let range = recording
        .followed()
        .context("nothing of experiment 4 was recorded")?;
    let figure = format!("{:.4}", told.mean_tip_error_m);
    report.shown(&name("mean tip error while the target moved, m"), figure);
    let lasted_s = (told.end_ns - told.begin_ns) as f64 * 1e-9;
    let figure = format!("{} and {} in {lasted_s:.1} s", told.plans, told.motions);
    report.shown(&name("plans and motions"), figure);
    let rested = recording.commanded(range.1).into();
    let error = body.tip_error(&rested, &told.requested_tip_m) / robot.section_lengths[0];
    let what = "tip error once the target rested, in section lengths";
    report.at_most(&name(what), error, 0.01);
    let measured_m = Point::from(told.measured_tip_m);
    let error_m = (measured_m - Point::from(told.requested_tip_m)).norm();
    let what = "tip error as measured, in section lengths";
    report.at_most(&name(what), error_m / robot.section_lengths[0], 0.03);
    let found = recording.clearance(body, range);
    let told_m = told.minimum_clearance_m;
    report.check(
        &name("least clearance to the ball, by dense sampling, m"),
        format!("{:.4}, at most {:.1e} less", found.sampled_m, found.error_m),
        &format!(">= 0, told: {told_m:.4}"),
        found.at_least_m() >= 0.0 && (told_m - found.sampled_m).abs() < 0.01,
    );
    let results: usize = told.outcomes.values().sum();
    report.check(
        &name("results told, of motions published"),
        format!("{results} of {}", told.motions),
        "all",
        results as u64 == told.motions,
    );
    let reached = told.outcomes.get("reached").copied().unwrap_or(0);
    report.check(
        &name("how the motions ended"),
        format!("{:?}, {} missing", told.outcomes, told.missing_results),
        "reached at least once, none missing",
        reached > 0 && told.missing_results == 0,
    );
    Ok(())
}
