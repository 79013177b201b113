//! `pcc evaluate` with four planners on the reference sample and on unseen general scenes.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, ensure};
use collision::{Ball, Scene, minimum_clearance};
use pcc_model::{Configuration, Point, Robot};
use planning::dataset::ArchiveReader;
use serde_json::Value;
use tests::programs::{program, repository};
use trajectory::{Knot, Trajectory, limit_use};

use crate::{Report, Scale};

const PLANNERS: [&str; 4] = ["default", "fast", "straight", "rrt-connect"];
/// Seed of the unseen scenes: no data set was made with it.
const UNSEEN_SEED: u64 = 9001;

pub(crate) fn run(report: &mut Report, scale: Scale) {
    let sample = repository().join("tests/data/reference-mixed-sample");
    let command = "pcc evaluate --dataset tests/data/reference-mixed-sample --planner …";
    report.group("reference sample", command, |report| {
        // 60 cases in all; the sample has no shorter form worth its name.
        evaluate_all(report, "reference", &sample, scale.pick(30, 60))
    });
    let command = "pcc dataset --setting general --test-only --seed 9001; pcc evaluate --planner …";
    report.group("unseen general scenes", command, |report| {
        let cases = scale.pick(40, 300);
        let dataset = unseen_general(cases)?;
        evaluate_all(report, "unseen general", &dataset, cases)
    });
}

pub(crate) fn folder() -> PathBuf {
    repository().join("target/acceptance")
}

pub(crate) fn run_pcc(arguments: &[&str]) -> anyhow::Result<()> {
    let output = Command::new(program("pcc"))
        .current_dir(repository())
        .args(arguments)
        .output()?;
    let error = String::from_utf8_lossy(&output.stderr);
    ensure!(
        output.status.success(),
        "pcc {}: {error}",
        arguments.join(" ")
    );
    Ok(())
}

/// Makes a data set, on top of what an interrupted run left, or anew where an older generator left something else.
pub(crate) fn make_dataset(arguments: &[&str], out: &Path) -> anyhow::Result<()> {
    let mut whole = vec!["dataset"];
    whole.extend(arguments);
    whole.extend(["--out", out.to_str().context("path")?]);
    if run_pcc(&whole).is_err() && out.exists() {
        std::fs::remove_dir_all(out)?;
        run_pcc(&whole)?;
    }
    Ok(())
}

/// One start a target and few end shapes: cases are wanted, not paths.
fn unseen_general(cases: usize) -> anyhow::Result<PathBuf> {
    let targets = (cases * 2).to_string();
    let out = folder().join(format!("general-{UNSEEN_SEED}-{targets}"));
    let seed = UNSEEN_SEED.to_string();
    let mut arguments = vec!["--setting", "general", "--test-only", "--seed", &seed];
    arguments.extend(["--targets", &targets, "--starts", "1", "--ends", "1"]);
    make_dataset(&arguments, &out)?;
    Ok(out)
}

/// What one planner did.
struct Evaluation {
    summary: Value,
    /// Cases with a certified candidate, with a certified learned one.
    answered: Vec<bool>,
    learned: Vec<bool>,
    /// Share of the first ten draws of every case that are certified, counted in `paths.npz`.
    share: f64,
    /// Certified motions that a second look at their knots contradicts, of how many.
    contradicted: Vec<String>,
    looked_at: usize,
}

fn evaluate_all(
    report: &mut Report,
    setting: &str,
    dataset: &Path,
    cases: usize,
) -> anyhow::Result<()> {
    let robot = Robot::from_file(&repository().join("config/robots/unit.toml"))?;
    let mut all = BTreeMap::new();
    for planner in PLANNERS {
        let out = folder().join(format!("{setting}-{planner}").replace(' ', "-"));
        let (count, path) = (cases.to_string(), out.to_str().context("path")?);
        let data = dataset.to_str().context("path")?;
        run_pcc(&[
            "evaluate",
            "--dataset",
            data,
            "--split",
            "test",
            "--planner",
            planner,
            "--candidates",
            "10",
            "--seed",
            "0",
            "--cases",
            &count,
            "--out",
            path,
        ])?;
        all.insert(planner, read(&robot, &out)?);
    }
    let evaluated = all["default"].answered.len();
    let at_least = cases.min(30);
    report.check(
        &format!("{setting}: cases"),
        evaluated.to_string(),
        &format!(">= {at_least}"),
        evaluated >= at_least,
    );
    for (planner, evaluation) in &all {
        let name = format!("{setting}: {planner}, certified motions contradicted by their knots");
        report.none_of(&name, &evaluation.contradicted);
        ensure!(evaluation.looked_at > 0, "{planner} certified nothing");
    }
    before_fallback(report, setting, &all)?;
    feasible(report, setting, &all);
    Ok(())
}

fn number(evaluation: &Evaluation, path: &str) -> anyhow::Result<f64> {
    let found = evaluation.summary.pointer(path).and_then(Value::as_f64);
    found.with_context(|| format!("result.json has no {path}"))
}

fn before_fallback(
    report: &mut Report,
    setting: &str,
    all: &BTreeMap<&str, Evaluation>,
) -> anyhow::Result<()> {
    let [fast, straight] = ["fast", "straight"].map(|planner| all[planner].share);
    let stated = number(&all["fast"], "/share_before_fallback")?;
    let name = format!("{setting}: fast, the share that result.json states");
    let agrees = (stated - fast).abs() < 1e-9;
    report.check(
        &name,
        format!("{:.2} %", 100.0 * stated),
        "as in paths.npz",
        agrees,
    );
    let figure = format!(
        "{:.2} % (null arm straight: {:.2} %)",
        100.0 * fast,
        100.0 * straight
    );
    let name = format!("{setting}: fast, certified before fallback");
    report.check(&name, figure, ">= 95 %", fast >= 0.95);
    let ratio = |planner: &str| number(&all[planner], "/tip_length_ratio/median");
    let (fast, straight) = (ratio("fast")?, ratio("straight")?);
    let name = format!("{setting}: fast, median tip length ÷ distance");
    let bar = format!("< {straight:.3} (null arm)");
    report.check(&name, format!("{fast:.3}"), &bar, fast < straight);
    Ok(())
}

/// Feasible: `default` or `rrt-connect` has a certified path.
fn feasible(report: &mut Report, setting: &str, all: &BTreeMap<&str, Evaluation>) {
    let (default, tree, fast) = (&all["default"], &all["rrt-connect"], &all["fast"]);
    let known = default.answered.iter().zip(&tree.answered);
    let feasible: Vec<usize> = known
        .enumerate()
        .filter_map(|(case, (a, b))| (*a || *b).then_some(case))
        .collect();
    let learned = feasible.iter().filter(|&&case| fast.learned[case]).count();
    let share = learned as f64 / feasible.len().max(1) as f64;
    let figure = format!("{:.2} % ({learned} of {})", 100.0 * share, feasible.len());
    let name = format!("{setting}: feasible requests with a learned candidate");
    report.check(&name, figure, ">= 99.5 %", share >= 0.995);
    let answered = feasible
        .iter()
        .filter(|&&case| default.answered[case])
        .count();
    let name = format!("{setting}: feasible requests answered by default");
    report.all_of(&name, answered, feasible.len());
}

fn read(robot: &Robot, folder: &Path) -> anyhow::Result<Evaluation> {
    let summary: Value =
        serde_json::from_str(&std::fs::read_to_string(folder.join("result.json"))?)?;
    let mut archive = ArchiveReader::open(&folder.join("paths.npz"))?;
    let (certified, shape) = archive.read::<u8>("certified")?;
    let source = archive.read::<u8>("source")?.0;
    let slots = usize::try_from(shape[1])?;
    let rows = || {
        certified
            .chunks_exact(slots)
            .zip(source.chunks_exact(slots))
    };
    let is_learned = |(c, s): (&u8, &u8)| *c == 1 && *s == 1;
    let (looked_at, contradicted) = second_look(robot, &mut archive, &certified, slots)?;
    Ok(Evaluation {
        summary,
        answered: rows().map(|(c, _)| c.contains(&1)).collect(),
        share: certified.iter().filter(|c| **c == 1).count() as f64 / certified.len() as f64,
        learned: rows()
            .map(|(c, s)| c.iter().zip(s).any(is_learned))
            .collect(),
        contradicted,
        looked_at,
    })
}

/// Judges certified motions by their knots alone: start, tip, bending, tendon limits, least clearance of the whole motion.
fn second_look(
    robot: &Robot,
    archive: &mut ArchiveReader,
    certified: &[u8],
    slots: usize,
) -> anyhow::Result<(usize, Vec<String>)> {
    let motions = Motions::read(archive)?;
    let all: Vec<usize> = (0..certified.len())
        .filter(|&i| certified[i] == 1)
        .collect();
    let mut contradicted = Vec::new();
    for &slot in &all {
        let case = slot / slots;
        if let Err(error) = motions.judge(robot, case, slot) {
            contradicted.push(format!("case {case}, candidate {}: {error}", slot % slots));
        }
    }
    Ok((all.len(), contradicted))
}

/// The arrays of `paths.npz` that say what would be executed.
struct Motions {
    starts: Vec<f64>,
    targets: Vec<f64>,
    scenes: Vec<Scene>,
    times: Vec<f64>,
    knots: Vec<f64>,
    width: usize,
}

impl Motions {
    fn read(archive: &mut ArchiveReader) -> anyhow::Result<Self> {
        let centres: Vec<f64> = archive.read("obstacle_centres")?.0;
        let radii: Vec<f64> = archive.read("obstacle_radii")?.0;
        let offsets: Vec<i64> = archive.read("obstacle_offsets")?.0;
        let ball = |i: usize| Ball {
            centre: Point::from_column_slice(&centres[3 * i..3 * i + 3]),
            radius: radii[i],
        };
        let scene = |pair: &[i64]| {
            Ok(Scene::new(
                (pair[0] as usize..pair[1] as usize).map(ball).collect(),
            )?)
        };
        let (times, shape) = archive.read("knot_time")?;
        Ok(Self {
            starts: archive.read("starts")?.0,
            targets: archive.read("target_tips")?.0,
            scenes: offsets
                .windows(2)
                .map(scene)
                .collect::<anyhow::Result<_>>()?,
            times,
            knots: archive.read("knots")?.0,
            width: usize::try_from(shape[2])?,
        })
    }

    fn trajectory(&self, slot: usize) -> anyhow::Result<Trajectory> {
        let times = &self.times[slot * self.width..(slot + 1) * self.width];
        let knot = |(i, time): (usize, &f64)| {
            let at = (slot * self.width + i) * 18;
            let part = |k: usize| {
                Configuration::from_column_slice(&self.knots[at + 6 * k..at + 6 * k + 6])
            };
            Knot {
                time: *time,
                position: part(0),
                velocity: part(1),
                acceleration: part(2),
            }
        };
        let known = times
            .iter()
            .enumerate()
            .filter(|(_, time)| time.is_finite());
        Ok(Trajectory::new(known.map(knot).collect())?)
    }

    fn judge(&self, robot: &Robot, case: usize, slot: usize) -> anyhow::Result<()> {
        let motion = self.trajectory(slot)?;
        let start = Configuration::from_column_slice(&self.starts[6 * case..6 * case + 6]);
        let target = Point::from_column_slice(&self.targets[3 * case..3 * case + 3]);
        let end = motion.at(motion.duration()).position;
        let away = (motion.at(0.0).position - start).norm();
        ensure!(away <= 1e-6, "starts {away} rad away");
        let error = (robot.tip(&end) - target).norm();
        ensure!(error <= 0.01, "tip error {error}");
        let excess = motion
            .sample(200)
            .iter()
            .map(|q| robot.limit_excess(q))
            .fold(f64::MIN, f64::max);
        ensure!(excess <= 5e-3, "bends {excess} rad too far");
        let limits = limit_use(&motion, &robot.tendons, &robot.tendon_limits).largest();
        ensure!(limits <= 1.0 + 1e-6, "uses {limits} of its limits");
        let clearance = minimum_clearance(robot, &self.scenes[case], &motion, 1e-4);
        ensure!(clearance >= 0.0, "clearance {clearance}");
        Ok(())
    }
}
