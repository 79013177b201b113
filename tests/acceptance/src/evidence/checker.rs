//! Certified motions judged, and their tip paths measured, by NumPy: no geometry and no time law of this project.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, bail, ensure};
use serde_json::Value;
use tests::programs::repository;

use super::comparison::{LEAST_AHEAD, LENGTH_AT_MOST, NULL_ARM, RIVALS, compare, out};
use super::planners::{BY_THE_CLOCK, planners};
use crate::paper_python::environment;
use crate::report::Report;
use crate::runs::{Evaluation, number};
use crate::scale::Scale;

/// Motions of a folder of which damaged copies are judged.
const COPIED: f64 = 3.0;
/// Ways in which each is damaged.
const DAMAGES: f64 = 6.0;

pub(super) fn run(report: &mut Report, scale: Scale) {
    let command = "scripts/check_motions.py";
    report.group("checker", command, |report| {
        let python = environment("venv-numpy", "NumPy", |pip| {
            pip.arg("numpy>=2.0");
        })?;
        let compared = compare(scale, "fast")?;
        let cases = scale.pick(20, 250);
        let mut all = Judged {
            python,
            ..Judged::default()
        };
        for set in compared["sets"].as_array().context("no sets")? {
            let set = set["set"].as_str().context("no name")?;
            let dataset = dataset_of(scale, set)?;
            for planner in planners() {
                let records = out(scale).join(format!("cases/{set}-{planner}.jsonl"));
                let evaluation = Evaluation::of(set, &dataset, planner, cases);
                let evaluation = if BY_THE_CLOCK.contains(&planner) {
                    // No other run draws the same.
                    let evaluation = evaluation.with("--records", &records.display());
                    evaluation.repeat()?;
                    evaluation
                } else {
                    evaluation.run(report, scale)?;
                    evaluation
                };
                let tips = all.judge(&evaluation.out(), &dataset, &records)?;
                all.tips.insert((set.to_owned(), planner), tips);
            }
            for rival in RIVALS {
                all.tell_tips(report, set, rival);
            }
        }
        all.tell(report);
        Ok(())
    });
}

/// The cases of a set of the comparison.
fn dataset_of(scale: Scale, set: &str) -> anyhow::Result<PathBuf> {
    let there = fs::read_dir(out(scale).join("sets"))?.flatten();
    let is_of_set = |it: &fs::DirEntry| {
        let name = it.file_name().to_string_lossy().into_owned();
        name.rsplit_once('-').is_some_and(|(name, _)| name == set)
    };
    let found: Vec<PathBuf> = there.filter(is_of_set).map(|it| it.path()).collect();
    match <[PathBuf; 1]>::try_from(found) {
        Ok([dataset]) => Ok(dataset),
        Err(found) => bail!("{} folders with cases of set {set}", found.len()),
    }
}

/// What the checker said so far.
#[derive(Default)]
struct Judged {
    python: PathBuf,
    motions: f64,
    /// Certified motions of the comparison, those that were judged, and those that are the same.
    recorded: [f64; 3],
    contradicted: Vec<String>,
    damaged: f64,
    unnoticed: f64,
    /// By set and planner.
    tips: BTreeMap<(String, &'static str), Tips>,
}

/// For each case the medians over its certified motions of tip length ÷ distance and of tip smoothness; none where no motion is certified.
type Tips = Vec<Option<[f64; 2]>>;

impl Judged {
    /// Has the motions of an evaluation judged, and held against what the comparison has recorded of them; returns the figures of their tips.
    fn judge(&mut self, folder: &Path, dataset: &Path, records: &Path) -> anyhow::Result<Tips> {
        let mut checker = Command::new(&self.python);
        checker.current_dir(repository());
        checker.arg("scripts/check_motions.py").arg(folder);
        let tips = folder.join("tips.json");
        checker.arg("--dataset").arg(dataset);
        checker.arg("--tips").arg(&tips);
        checker.arg("--records").arg(records);
        let output = checker.output()?;
        let text = String::from_utf8_lossy(&output.stdout);
        let error = String::from_utf8_lossy(&output.stderr);
        let last = text.lines().last();
        let last = last.with_context(|| format!("the checker says nothing: {error}"))?;
        eprintln!("  {}: {last}", folder.display());
        let verdict: Value = serde_json::from_str(last)?;
        let (motions, damaged) = (number(&verdict, "/judged")?, number(&verdict, "/damaged")?);
        ensure!(
            damaged == DAMAGES * motions.min(COPIED),
            "{}: {damaged} damaged copies",
            folder.display()
        );
        self.motions += motions;
        self.damaged += damaged;
        self.unnoticed += number(&verdict, "/unnoticed")?;
        let texts = text.lines().filter(|line| line.starts_with("  "));
        let of_folder = texts.map(|text| format!("{}: {text}", folder.display()));
        self.contradicted.extend(of_folder);
        let counts = ["/recorded", "/certified", "/same"];
        for (sum, count) in self.recorded.iter_mut().zip(counts) {
            *sum += number(&verdict, count)?;
        }
        Ok(serde_json::from_str(&fs::read_to_string(tips)?)?)
    }

    /// The tips of `fast` beside a rival's in the cases that the rival solves, with the bars of group `comparison`.
    fn tell_tips(&self, report: &mut Report, set: &str, rival: &'static str) {
        let of = |planner| &self.tips[&(set.to_owned(), planner)];
        assert_eq!(
            of("fast").len(),
            of(rival).len(),
            "cases of fast and of {rival} in {set}"
        );
        let pairs = of("fast").iter().zip(of(rival));
        let pairs: Vec<_> = pairs
            .filter_map(|(fast, rival)| Some((*fast, (*rival)?)))
            .collect();
        let ahead = |is: fn([f64; 2], [f64; 2]) -> bool| {
            let ahead = pairs
                .iter()
                .filter(|(fast, rival)| fast.is_some_and(|it| is(it, *rival)));
            100.0 * ahead.count() as f64 / pairs.len() as f64
        };
        let is_null_arm = rival == NULL_ARM;
        let shares = [
            ("shorter", true, ahead(|a, b| a[0] < b[0])),
            ("smoother", is_null_arm, ahead(|a, b| a[1] < b[1])),
            (
                "shorter and smoother",
                is_null_arm,
                ahead(|a, b| a[0] < b[0] && a[1] < b[1]),
            ),
        ];
        let line = |what: &str| {
            format!(
                "{set}: tips measured by NumPy, fast beside {rival}: {what}, of the {} cases that {rival} solves",
                pairs.len()
            )
        };
        for (what, has_bar, share) in shares {
            let figure = format!("{share:.1} %");
            if set == "hard" && has_bar {
                let bar = format!(">= {LEAST_AHEAD} %");
                report.check(&line(what), figure, &bar, share >= LEAST_AHEAD);
            } else {
                report.shown(&line(what), figure);
            }
        }
        if set != "hard" && is_null_arm {
            tell_lengths(report, set, rival, &pairs);
        }
    }

    fn tell(&self, report: &mut Report) {
        let line = format!("motions contradicted, of {} of all planners", self.motions);
        report.none_of(&line, &self.contradicted);
        let (judged, damaged) = (self.motions, self.damaged);
        report.check("motions judged", judged.to_string(), "> 0", judged > 0.0);
        report.check(
            "damaged copies of motions (start, limits, bending, target, contact, grazing contact) in which that is found",
            format!("{} of {damaged}", damaged - self.unnoticed),
            "all, > 0",
            damaged > 0.0 && self.unnoticed == 0.0,
        );
        let [recorded, certified, same] = self.recorded;
        report.check(
            "certified motions of the comparison that were judged, each as long as it is recorded",
            format!("{same} of {recorded}, of {certified} judged"),
            "all, > 0",
            recorded > 0.0 && same == recorded && certified == recorded,
        );
    }
}

/// The tip lengths of `fast` ÷ a rival's in the cases that both solve.
fn tell_lengths(
    report: &mut Report,
    set: &str,
    rival: &str,
    pairs: &[(Option<[f64; 2]>, [f64; 2])],
) {
    let ratios = pairs
        .iter()
        .filter_map(|(fast, rival)| Some((*fast)?[0] / rival[0]));
    let ratios: Vec<f64> = ratios.collect();
    // Not a number without any, which fails.
    let largest = ratios.iter().copied().fold(f64::NAN, f64::max);
    let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
    for ((what, ratio), bar) in [("largest", largest), ("mean", mean)]
        .into_iter()
        .zip(LENGTH_AT_MOST)
    {
        let line = format!(
            "{set}: tips measured by NumPy, fast beside {rival}: tip length ÷ the other's, {what} of the {} cases that both solve",
            ratios.len()
        );
        report.at_most(&line, ratio, bar);
    }
}
