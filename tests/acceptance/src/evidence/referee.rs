//! OMPL's planners, as an outside referee of the classical planners in hard and in crowded scenes.

use std::path::PathBuf;
use std::process::Command;

use anyhow::{Context, ensure};
use serde_json::Value;
use tests::programs::repository;

use super::planners::BY_THE_CLOCK;
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
        let (hard, crowded) = (scale.pick(10, 150), scale.pick(10, 100));
        let all = [
            Scenes {
                name: HARD.name,
                title: HARD.title(),
                dataset: HARD.make(hard)?,
                cases: hard,
            },
            Scenes {
                name: "crowded",
                title: "8 to 16 balls (every case that is drawn)",
                dataset: fast_crowded::make(crowded)?,
                cases: crowded,
            },
        ];
        for scenes in &all {
            scenes.until_a_path_is_found(report, scale)?;
        }
        let hard = Scenes {
            cases: scale.pick(6, 60),
            ..all[0].clone()
        };
        let by_the_clock = BY_THE_CLOCK.iter();
        by_the_clock
            .copied()
            .try_for_each(|planner| hard.for_short_tip_paths(report, scale, planner))
    });
}

/// Cases of a kind.
#[derive(Clone)]
struct Scenes {
    name: &'static str,
    title: &'static str,
    dataset: PathBuf,
    cases: usize,
}

impl Scenes {
    /// `rrt-connect`, and `rrt-smooth` on top of it, beside OMPL's RRT-Connect and its simplifier.
    fn until_a_path_is_found(&self, report: &mut Report, scale: Scale) -> anyhow::Result<()> {
        let ompl = self.ompl(report, scale, "rrt-connect", ATTEMPTS)?;
        for (own, what) in [
            ("rrt-connect", "not smoothed"),
            ("rrt-smooth", "with all that a learned path gets"),
        ] {
            let own_result = self.evaluation(own, ATTEMPTS).run(report, scale)?;
            self.compare(
                report,
                &format!("{own}, {what}, beside OMPL's RRT-Connect and simplifier"),
                &own_result,
                &ompl,
            )?;
        }
        Ok(())
    }

    /// A planner that ends by the clock beside OMPL's, whose objective is the tip's path as well.
    fn for_short_tip_paths(
        &self,
        report: &mut Report,
        scale: Scale,
        planner: &str,
    ) -> anyhow::Result<()> {
        let ompl = self.ompl(report, scale, planner, 1)?;
        let own = self.evaluation(planner, 1).run(report, scale)?;
        let line = format!("{planner} in 50 ms beside OMPL's");
        self.compare(report, &line, &own, &ompl)
    }

    fn evaluation<'a>(&'a self, planner: &'a str, attempts: usize) -> Evaluation<'a> {
        Evaluation::of(self.name, &self.dataset, planner, self.cases).candidates(attempts)
    }

    /// What OMPL's paths come to, corrected as learned ones are.
    fn ompl(
        &self,
        report: &mut Report,
        scale: Scale,
        planner: &str,
        attempts: usize,
    ) -> anyhow::Result<Value> {
        // Its paths end in each distinct goal configuration, whatever is in their way.
        let goals = self.evaluation("straight", attempts);
        goals.run(report, scale)?;
        let proposals = format!("target/acceptance/ompl-{planner}-{}.npz", self.name);
        let asked = ask(planner, &goals, &proposals)?;
        report.shown(
            &format!(
                "{}, OMPL's {planner}: paths found of attempts, in ten seconds each at most",
                self.title
            ),
            format!(
                "{} of {}, {:.0} ms an attempt",
                number(&asked, "/found")?,
                number(&asked, "/attempts")?,
                1e3 * number(&asked, "/seconds_an_attempt")?
            ),
        );
        self.evaluation("proposed", attempts)
            .with("--proposals", &proposals)
            .repeat()
    }

    fn compare(
        &self,
        report: &mut Report,
        line: &str,
        own: &Value,
        ompl: &Value,
    ) -> anyhow::Result<()> {
        let solved = |result: &Value| number(result, "/success_any");
        let (own_solved, other) = (solved(own)?, solved(ompl)?);
        report.check(
            &format!("{}, cases with a certified motion: {line}", self.title),
            format!("{own_solved:.3} beside {other:.3} of {}", self.cases),
            "no fewer",
            own_solved >= other,
        );
        let length = |result: &Value| number(result, "/tip_length_ratio/median");
        let (own_length, other) = (length(own)?, length(ompl)?);
        report.check(
            &format!("{}, tip length ÷ distance, median: {line}", self.title),
            format!("{own_length:.3} beside {other:.3}"),
            "no longer",
            own_length <= other,
        );
        Ok(())
    }
}

/// Has OMPL's planner answer the cases of an evaluation, to this file; what its script says in the end.
fn ask(planner: &str, goals: &Evaluation, proposals: &str) -> anyhow::Result<Value> {
    let python = environment("venv-ompl", "OMPL", |pip| {
        pip.args(["ompl>=2.0", "numpy>=2.0"]);
    })?;
    let output = Command::new(&python)
        .current_dir(repository())
        .arg(SCRIPT)
        .arg(goals.out())
        .args(["--planner", planner, "--out", proposals])
        .output()?;
    let error = String::from_utf8_lossy(&output.stderr);
    ensure!(output.status.success(), "{SCRIPT}: {error}");
    let text = String::from_utf8_lossy(&output.stdout);
    let last = text.lines().last().context("the referee says nothing")?;
    Ok(serde_json::from_str(last)?)
}
