//! From a changed goal to the first set-point of the joined motion.

use std::time::Instant;

use tests::world::Settings;

use super::figures::{Figures, quantile};
use super::joins::what_was_asked;
use super::replan_run::{Population, run as replan};
use crate::report::Report;
use crate::scale::Scale;
use crate::stolen::StolenTimes;

/// Windows of which the one with the least share of stolen time counts.
const WINDOWS: usize = 5;

/// One window's replans, in order.
struct Window {
    took_ms: Vec<f64>,
    stolen_ms: f64,
    lasted_s: f64,
}

impl Window {
    fn at(&self, share: f64) -> f64 {
        quantile(&self.took_ms, share)
    }

    fn stolen_share(&self) -> f64 {
        1e-3 * self.stolen_ms / self.lasted_s
    }

    fn text(&self) -> String {
        format!(
            "median {:.2}, p90 {:.2}, p99 {:.2} ms of {} replans, {:.1} ms stolen in {:.0} s",
            self.at(0.5),
            self.at(0.9),
            self.at(0.99),
            self.took_ms.len(),
            self.stolen_ms,
            self.lasted_s
        )
    }
}

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
    let all = &figures.to_setpoint_ms;
    let length = all.len().div_ceil(WINDOWS).max(1);
    let windows: Vec<Window> = all
        .chunks(length)
        .map(|part| window(part, stolen))
        .collect();
    let line = |what: &str| format!("replans, general scenes, ten candidates: {what}");
    what_was_asked(report, &line, figures);
    for (index, window) in windows.iter().enumerate() {
        report.shown(
            &line(&format!("window {index}, goal to first set-point")),
            window.text(),
        );
    }
    for (name, times_ms) in &figures.times_ms {
        let [median, p90, p99] = [0.5, 0.9, 0.99].map(|share| quantile(times_ms, share));
        let figure = format!("median {median:.2}, p90 {p90:.2}, p99 {p99:.2} ms");
        report.shown(&line(&format!("time until or of: {name}")), figure);
    }
    let quietest = windows
        .iter()
        .min_by(|a, b| a.stolen_share().total_cmp(&b.stolen_share()));
    report.check(
        &line("switches that were begun"),
        figures.switched.to_string(),
        "> 0",
        figures.switched > 0,
    );
    if let Some(quietest) = quietest {
        let what =
            "goal to first set-point in the window with the least share of stolen time, median ms";
        report.at_most(&line(what), quietest.at(0.5), 6.0);
        let what =
            "goal to first set-point in the window with the least share of stolen time, p99 ms";
        report.at_most(&line(what), quietest.at(0.99), 15.0);
    }
    let refused: usize = figures.refusals.values().sum();
    let missed = refused + figures.not_begun.len() + figures.made_again.len();
    let replans = figures.joined + refused;
    let share = 100.0 * missed as f64 / replans.max(1) as f64;
    let figure = format!(
        "{share:.2} % of {replans}: made again {:?}, published and not begun {:?}, refused {:?}",
        figures.made_again, figures.not_begun, figures.refusals
    );
    let what = "switches missed (those made again count their whole time above)";
    report.check(&line(what), figure, "<= 2 %", share <= 2.0);
}

fn window(part: &[(Instant, f64)], stolen: &StolenTimes) -> Window {
    let (begin, end) = (part[0].0, part[part.len() - 1].0);
    Window {
        took_ms: part.iter().map(|(_, took_ms)| *took_ms).collect(),
        stolen_ms: stolen.between(begin, end).as_secs_f64() * 1e3,
        lasted_s: (end - begin).as_secs_f64(),
    }
}
