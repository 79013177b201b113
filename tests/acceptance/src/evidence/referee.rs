//! OMPL's RRT-Connect and path simplifier, as an outside referee of the classical planners in hard and in crowded scenes.

use std::path::Path;
use std::process::Command;

use anyhow::{Context, ensure};
use serde_json::Value;
use tests::programs::repository;

use crate::fast_crowded;
use crate::paper_python::environment;
use crate::paper_runs::HARD;
use crate::report::Report;
use crate::runs::{Evaluation, number};
use crate::scale::Scale;

/// Attempts a case: each of OMPL's takes seconds, since its collision checks are Python's.
const ATTEMPTS: usize = 2;
const SCRIPT: &str = "scripts/ompl_referee.py";

pub(super) fn run(report: &mut Report, scale: Scale) {
    report.group("an outside referee", SCRIPT, |report| {
        let hard = HARD.make(scale.pick(10, 150))?;
        compare(
            report,
            scale,
            HARD.name,
            HARD.title(),
            &hard,
            scale.pick(10, 150),
        )?;
        let count = scale.pick(10, 100);
        let crowded = fast_crowded::make(count)?;
        let title = "8 to 16 balls (every case that is drawn)";
        compare(report, scale, "crowded", title, &crowded, count)
    });
}

/// The classical planners beside OMPL's on some cases.
fn compare(
    report: &mut Report,
    scale: Scale,
    name: &str,
    title: &str,
    dataset: &Path,
    cases: usize,
) -> anyhow::Result<()> {
    let evaluation = |planner| Evaluation::of(name, dataset, planner, cases).candidates(ATTEMPTS);
    // Its paths end in each distinct goal configuration, whatever is in their way.
    let goals = evaluation("straight");
    goals.run(report, scale)?;
    let proposals = format!("target/acceptance/ompl-{name}.npz");
    let asked = ask(&goals, &proposals)?;
    let ompl = evaluation("proposed")
        .with("--proposals", &proposals)
        .repeat()?;
    report.shown(
        &format!("{title}, OMPL: paths found of attempts, in ten seconds each"),
        format!(
            "{} of {}, {:.0} ms an attempt",
            number(&asked, "/found")?,
            number(&asked, "/attempts")?,
            1e3 * number(&asked, "/seconds_an_attempt")?
        ),
    );
    let [connect, smooth] =
        ["rrt-connect", "rrt-smooth"].map(|it| evaluation(it).run(report, scale));
    let (connect, smooth) = (connect?, smooth?);
    let solved = |result: &Value| number(result, "/success_any");
    let (own, other) = (solved(&connect)?, solved(&ompl)?);
    report.check(
        &format!("{title}, cases with a certified motion: rrt-connect beside OMPL's RRT-Connect"),
        format!("{own:.3} beside {other:.3} of {cases}"),
        "no fewer",
        own >= other,
    );
    let length = |result: &Value| number(result, "/tip_length_ratio/median");
    let (own, other) = (length(&connect)?, length(&ompl)?);
    report.check(
        &format!(
            "{title}, tip length ÷ distance, median: rrt-connect, not smoothed, beside OMPL's simplified paths, corrected as learned ones are"
        ),
        format!("{own:.3} beside {other:.3}"),
        "no longer",
        own <= other,
    );
    report.shown(
        &format!(
            "{title}, tip length ÷ distance, median: rrt-smooth, with all that a learned path gets"
        ),
        format!("{:.3}", length(&smooth)?),
    );
    Ok(())
}

/// Has OMPL answer the cases of an evaluation, to this file; what its script says in the end.
fn ask(goals: &Evaluation, proposals: &str) -> anyhow::Result<Value> {
    let python = environment("venv-ompl", "OMPL", |pip| {
        pip.args(["ompl>=2.0", "numpy>=2.0"]);
    })?;
    let output = Command::new(&python)
        .current_dir(repository())
        .arg(SCRIPT)
        .arg(goals.out())
        .arg("--out")
        .arg(proposals)
        .output()?;
    let error = String::from_utf8_lossy(&output.stderr);
    ensure!(output.status.success(), "{SCRIPT}: {error}");
    let text = String::from_utf8_lossy(&output.stdout);
    let last = text.lines().last().context("the referee says nothing")?;
    Ok(serde_json::from_str(last)?)
}
