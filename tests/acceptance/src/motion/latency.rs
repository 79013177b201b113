//! From a changed goal to the first set-point of the joined motion.

use tests::world::Settings;

use super::figures::Figures;
use super::joins::what_was_asked;
use super::replan_run::{Population, run as replan};
use super::windows::{WINDOWS, quantiles_text, show_slowest, show_windows};
use crate::report::Report;
use crate::scale::Scale;
use crate::stolen::StolenTimes;

/// Replans in general scenes with ten candidates, at the shipped limits.
pub(super) fn run(report: &mut Report, scale: Scale) {
    let command = "requests to planner-daemon from a moving robot";
    report.group("replans, latency", command, |report| {
        let stolen = StolenTimes::watch()?;
        let population = Population {
            settings: Settings::default(),
            time_factor: 1.0,
            count: WINDOWS * scale.pick(20, 200),
        };
        let figures = replan(&population)?;
        show(report, &figures, &stolen);
        Ok(())
    });
}

fn show(report: &mut Report, figures: &Figures, stolen: &StolenTimes) {
    let line = |what: &str| format!("replans, general scenes, ten candidates: {what}");
    what_was_asked(report, &line, figures);
    for (name, times_ms) in &figures.times_ms {
        let what = format!("time until or of: {name}");
        report.shown(&line(&what), quantiles_text(times_ms));
    }
    report.check(
        &line("switches that were begun"),
        figures.switched.to_string(),
        "> 0",
        figures.switched > 0,
    );
    show_slowest(report, &line, figures.begun.clone());
    let mut to_setpoint_ms = figures.to_setpoint_ms.clone();
    to_setpoint_ms.sort_by_key(|(at, _)| *at);
    show_windows(report, &line, &to_setpoint_ms, stolen);
    let refused: usize = figures.refusals.values().sum();
    let missed =
        refused + figures.not_begun.len() + figures.made_again.len() + figures.began_at_rest;
    let replans = figures.in_motion;
    let share = 100.0 * missed as f64 / replans.max(1) as f64;
    let figure = format!(
        "{share:.2} % of {replans}: joined or made again {:?}, published and not begun {:?}, begun at rest {}, refused {:?}",
        figures.made_again, figures.not_begun, figures.began_at_rest, figures.refusals
    );
    let what = "switches missed (those joined again, made again or begun at rest count their whole time above, those refused or not begun no end)";
    report.check(&line(what), figure, "<= 2 %", share <= 2.0);
}
