//! OMPL's RRT-Connect and path simplifier, as an outside referee of the classical planners in hard scenes.

use std::process::Command;

use anyhow::{Context, ensure};
use serde_json::Value;
use tests::programs::repository;

use crate::paper_python::environment;
use crate::paper_runs::HARD;
use crate::report::Report;
use crate::runs::{Evaluation, number};
use crate::scale::Scale;

/// Attempts a case: each of OMPL's takes seconds, since its collision checks are Python's.
const ATTEMPTS: usize = 2;
const SCRIPT: &str = "scripts/ompl_referee.py";
/// Its paths, from the repository's folder.
const PROPOSALS: &str = "target/acceptance/ompl-hard.npz";

pub(super) fn run(report: &mut Report, scale: Scale) {
    report.group("an outside referee", SCRIPT, |report| {
        let cases = scale.pick(10, 150);
        let dataset = HARD.make(cases)?;
        let evaluation =
            |planner| Evaluation::of(HARD.name, &dataset, planner, cases).candidates(ATTEMPTS);
        // Its paths end in each distinct goal configuration, whatever is in their way.
        let goals = evaluation("straight");
        goals.run(report, scale)?;
        let asked = ask(&goals)?;
        let ompl = evaluation("proposed")
            .with("--proposals", PROPOSALS)
            .repeat()?;
        report.shown(
            "OMPL: paths found of attempts, in ten seconds each",
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
            "cases with a certified motion: rrt-connect beside OMPL's RRT-Connect",
            format!("{own:.3} beside {other:.3} of {cases}"),
            "no fewer",
            own >= other,
        );
        let length = |result: &Value| number(result, "/tip_length_ratio/median");
        let (own, other) = (length(&connect)?, length(&ompl)?);
        report.check(
            "tip length ÷ distance, median: rrt-connect beside OMPL's simplified paths, neither smoothed",
            format!("{own:.3} beside {other:.3}"),
            "no longer",
            own <= other,
        );
        report.shown(
            "tip length ÷ distance, median: rrt-smooth, with all that a learned path gets",
            format!("{:.3}", length(&smooth)?),
        );
        Ok(())
    });
}

/// Has OMPL answer the cases of an evaluation; what its script says in the end.
fn ask(goals: &Evaluation) -> anyhow::Result<Value> {
    let python = environment("venv-ompl", "OMPL", |pip| {
        pip.args(["ompl>=2.0", "numpy>=2.0"]);
    })?;
    let output = Command::new(&python)
        .current_dir(repository())
        .arg(SCRIPT)
        .arg(goals.out())
        .arg("--out")
        .arg(PROPOSALS)
        .output()?;
    let error = String::from_utf8_lossy(&output.stderr);
    ensure!(output.status.success(), "{SCRIPT}: {error}");
    let text = String::from_utf8_lossy(&output.stdout);
    let last = text.lines().last().context("the referee says nothing")?;
    Ok(serde_json::from_str(last)?)
}
