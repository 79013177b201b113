//! `pcc evaluate` with six planners on the reference sample and on unseen general scenes.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::Context;
use pcc_model::Robot;
use serde_json::Value;
use tests::programs::repository;

use crate::fast_cases::PLANNERS;
use crate::motions::Motions;
use crate::report::Report;
use crate::runs::{folder, make_dataset, number, run_pcc};
use crate::scale::Scale;

/// Seed of the unseen scenes: no data set was made with it.
const UNSEEN_SEED: u64 = 9001;

pub(crate) fn run(report: &mut Report, scale: Scale) {
    let sample = repository().join("tests/data/reference-mixed-sample");
    let command = "pcc evaluate --dataset tests/data/reference-mixed-sample --planner …";
    report.group("reference sample", command, |report| {
        // 60 cases in all; the sample has no shorter form worth its name.
        evaluate_all(report, "reference", &sample, scale.pick(30, 60))
    });
    let command = "pcc dataset --method cases --setting general --test-only --seed 9001; pcc evaluate --planner …";
    report.group("unseen general scenes", command, |report| {
        let cases = scale.pick(40, 300);
        let dataset = unseen_general(cases)?;
        evaluate_all(report, "unseen general", &dataset, cases)
    });
}

/// One start a target.
fn unseen_general(cases: usize) -> anyhow::Result<PathBuf> {
    let targets = (cases * 2).to_string();
    let out = folder().join(format!("cases-general-{UNSEEN_SEED}-{targets}"));
    let seed = UNSEEN_SEED.to_string();
    let mut arguments = vec!["--method", "cases", "--setting", "general", "--test-only"];
    arguments.extend(["--seed", &seed, "--targets", &targets, "--starts", "1"]);
    make_dataset(&arguments, &out)?;
    Ok(out)
}

/// What one planner did.
struct Evaluation {
    summary: Value,
    motions: Motions,
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
        all.insert(planner, read(&out, dataset)?);
    }
    let evaluated = all["default"].motions.cases();
    let at_least = cases.min(30);
    report.check(
        &format!("{setting}: cases"),
        evaluated.to_string(),
        &format!(">= {at_least}"),
        evaluated >= at_least,
    );
    for (planner, evaluation) in &all {
        let judged = evaluation.motions.judge(&robot, 1);
        judged.check(report, &format!("{setting}: {planner}"));
    }
    before_fallback(report, setting, &all)?;
    feasible(report, setting, &all);
    Ok(())
}

fn before_fallback(
    report: &mut Report,
    setting: &str,
    all: &BTreeMap<&str, Evaluation>,
) -> anyhow::Result<()> {
    let [certified, straight] = ["fast", "straight"].map(|planner| all[planner].motions.share());
    let fast = number(&all["fast"].summary, "/share_before_fallback")?;
    let name = format!("{setting}: fast, the share that result.json states");
    report.check(
        &name,
        format!("{:.2} %", 100.0 * fast),
        "as paths.npz has it",
        (fast - certified).abs() <= 1e-9,
    );
    let figure = format!(
        "{:.2} % (null arm straight: {:.2} %)",
        100.0 * fast,
        100.0 * straight
    );
    let name = format!("{setting}: fast, certified before fallback");
    report.check(&name, figure, ">= 95 %", fast >= 0.95);
    let ratio = |planner: &str| number(&all[planner].summary, "/tip_length_ratio/median");
    let (fast, straight) = (ratio("fast")?, ratio("straight")?);
    let name = format!("{setting}: fast, median tip length ÷ distance");
    let bar = format!("< {straight:.3} (null arm)");
    report.check(&name, format!("{fast:.3}"), &bar, fast < straight);
    Ok(())
}

/// Feasible: `default` or `rrt-connect` has a certified path.
fn feasible(report: &mut Report, setting: &str, all: &BTreeMap<&str, Evaluation>) {
    let motions = |planner: &str| &all[planner].motions;
    let (default, tree) = (motions("default"), motions("rrt-connect"));
    let is_feasible = |&case: &usize| default.is_answered(case) || tree.is_answered(case);
    let feasible: Vec<usize> = (0..default.cases()).filter(is_feasible).collect();
    let count = |holds: &dyn Fn(usize) -> bool| feasible.iter().filter(|c| holds(**c)).count();
    let learned = count(&|case| motions("fast").has_learned(case));
    let share = learned as f64 / feasible.len().max(1) as f64;
    let figure = format!("{:.2} % ({learned} of {})", 100.0 * share, feasible.len());
    let name = format!("{setting}: feasible requests with a learned candidate");
    report.check(&name, figure, ">= 99.5 %", share >= 0.995);
    let answered = count(&|case| default.is_answered(case));
    let name = format!("{setting}: feasible requests answered by default");
    report.all_of(&name, answered, feasible.len());
}

fn read(folder: &Path, dataset: &Path) -> anyhow::Result<Evaluation> {
    let summary = std::fs::read_to_string(folder.join("result.json"))?;
    Ok(Evaluation {
        summary: serde_json::from_str(&summary)?,
        motions: Motions::read(folder, dataset)?,
    })
}
