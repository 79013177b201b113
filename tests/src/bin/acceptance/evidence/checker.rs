//! Certified motions judged by numpy: no geometry and no time law of this project.

use std::process::Command;

use anyhow::Context;
use serde_json::Value;
use tests::programs::repository;

use super::planners::planners;
use crate::fast_cases;
use crate::paper_python::environment;
use crate::paper_runs::{HARD, MIXED};
use crate::report::Report;
use crate::runs::{Evaluation, Unseen, number};
use crate::scale::Scale;

/// General cases, whoever solves them.
const GENERAL: Unseen = Unseen {
    seed: 9001,
    targets_for_ten_cases: 5,
    ..fast_cases::GENERAL
};

pub(super) fn run(report: &mut Report, scale: Scale) {
    let command = "scripts/check_motions.py";
    report.group("checker", command, |report| {
        let python = environment("venv-numpy", "NumPy", |pip| {
            pip.arg("numpy>=2.0");
        })?;
        let (mut judged, mut contradicted) = (0.0, Vec::new());
        for unseen in [MIXED, GENERAL, HARD] {
            let cases = scale.pick(10, 250);
            let dataset = unseen.make(cases)?;
            for planner in planners() {
                let evaluation = Evaluation::of(unseen.name, &dataset, planner, cases);
                evaluation.run(report, scale)?;
                let output = Command::new(&python)
                    .current_dir(repository())
                    .arg("scripts/check_motions.py")
                    .arg(evaluation.out())
                    .output()?;
                let text = String::from_utf8_lossy(&output.stdout);
                let last = text.lines().last().context("the checker says nothing")?;
                let verdict: Value = serde_json::from_str(last)?;
                judged += number(&verdict, "/judged")?;
                let texts = text.lines().filter(|line| line.starts_with("  "));
                contradicted
                    .extend(texts.map(|text| format!("{}, {planner}: {text}", unseen.name)));
                eprintln!("  {}, {planner}: {last}", unseen.name);
            }
        }
        let line = format!("motions contradicted, of {judged} of all planners");
        report.none_of(&line, &contradicted);
        report.check("motions judged", judged.to_string(), "> 0", judged > 0.0);
        Ok(())
    });
}
