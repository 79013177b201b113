//! Certified motions judged by numpy: no geometry and no time law of this project.

use std::path::Path;
use std::process::Command;

use anyhow::{Context, ensure};
use serde_json::Value;
use tests::programs::repository;

use super::comparison::compare;
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

/// Damaged copies of a folder's first motion.
const DAMAGES: f64 = 5.0;
/// Planners that end by the clock: another run makes other motions.
const BY_THE_CLOCK: [&str; 2] = ["rrt-star", "bit-star"];

pub(super) fn run(report: &mut Report, scale: Scale) {
    let command = "scripts/check_motions.py";
    report.group("checker", command, |report| {
        let python = environment("venv-numpy", "NumPy", |pip| {
            pip.arg("numpy>=2.0");
        })?;
        let compared = compare(scale, "fast")?;
        let mut all = Judged::default();
        let (mut same, mut planned) = (0, 0);
        for (unseen, set) in [(MIXED, "reference"), (GENERAL, "general"), (HARD, "hard")] {
            let cases = scale.pick(20, 250);
            let dataset = unseen.make(cases)?;
            for planner in planners() {
                let evaluation = Evaluation::of(unseen.name, &dataset, planner, cases);
                evaluation.run(report, scale)?;
                let certified = all.judge(&python, &evaluation.out(), &dataset)?;
                if !BY_THE_CLOCK.contains(&planner) {
                    planned += 1;
                    same += usize::from(certified == certified_in(&compared, set, planner)?);
                }
            }
        }
        all.tell(report);
        report.all_of(
            "sets and planners with as many certified motions as in the comparison, but for those that end by the clock",
            same,
            planned,
        );
        Ok(())
    });
}

/// What the checker said so far.
#[derive(Default)]
struct Judged {
    motions: f64,
    contradicted: Vec<String>,
    damaged: f64,
    unnoticed: f64,
}

impl Judged {
    /// Has the motions of an evaluation judged; how many of them are certified.
    fn judge(&mut self, python: &Path, folder: &Path, dataset: &Path) -> anyhow::Result<u64> {
        let output = Command::new(python)
            .current_dir(repository())
            .arg("scripts/check_motions.py")
            .arg(folder)
            .arg("--dataset")
            .arg(dataset)
            .output()?;
        let text = String::from_utf8_lossy(&output.stdout);
        let error = String::from_utf8_lossy(&output.stderr);
        let last = text.lines().last();
        let last = last.with_context(|| format!("the checker says nothing: {error}"))?;
        eprintln!("  {}: {last}", folder.display());
        let verdict: Value = serde_json::from_str(last)?;
        let (motions, damaged) = (number(&verdict, "/judged")?, number(&verdict, "/damaged")?);
        ensure!(
            motions == 0.0 || damaged == DAMAGES,
            "{}: {damaged} damaged copies",
            folder.display()
        );
        self.motions += motions;
        self.damaged += damaged;
        self.unnoticed += number(&verdict, "/unnoticed")?;
        let texts = text.lines().filter(|line| line.starts_with("  "));
        let of_folder = texts.map(|text| format!("{}: {text}", folder.display()));
        self.contradicted.extend(of_folder);
        Ok(number(&verdict, "/certified")? as u64)
    }

    fn tell(&self, report: &mut Report) {
        let line = format!("motions contradicted, of {} of all planners", self.motions);
        report.none_of(&line, &self.contradicted);
        let (judged, damaged) = (self.motions, self.damaged);
        report.check("motions judged", judged.to_string(), "> 0", judged > 0.0);
        report.check(
            "damaged copies of motions (start, limits, bending, target, contact) in which that is found",
            format!("{} of {damaged}", damaged - self.unnoticed),
            "all, > 0",
            damaged > 0.0 && self.unnoticed == 0.0,
        );
    }
}

/// How many certified motions a planner has in a set of the comparison.
fn certified_in(compared: &Value, set: &str, planner: &str) -> anyhow::Result<u64> {
    let set = named(&compared["sets"], "set", set)?;
    let of_planner = named(&set["planners"], "planner", planner)?;
    let asked = number(set, "/cases")? * number(compared, "/candidates")?;
    Ok((number(of_planner, "/all/certified/value")? * asked).round() as u64)
}

/// What has a name in a list.
fn named<'a>(list: &'a Value, key: &str, name: &str) -> anyhow::Result<&'a Value> {
    let list = list.as_array().context("no list")?;
    let found = list.iter().find(|it| it[key] == name);
    found.with_context(|| format!("no {name}"))
}
