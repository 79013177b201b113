//! Times from a goal to the first set-point of a motion to it, in windows of which the quietest counts.

use std::time::Instant;

use super::figures::quantile;
use crate::report::Report;
use crate::stolen::StolenTimes;

/// Windows of which the one with the least share of stolen time counts.
pub(super) const WINDOWS: usize = 5;
/// Slowest times that are shown one by one.
const SLOWEST: usize = 8;

/// One window's goals, in order.
struct Window {
    took_ms: Vec<f64>,
    stolen_ms: f64,
    lasted_s: f64,
}

impl Window {
    /// Of goals that were given at these instants.
    fn of(part: &[(Instant, f64)], stolen: &StolenTimes) -> Self {
        let (begin, end) = (part[0].0, part[part.len() - 1].0);
        Self {
            took_ms: part.iter().map(|(_, took_ms)| *took_ms).collect(),
            stolen_ms: stolen.between(begin, end).as_secs_f64() * 1e3,
            lasted_s: (end - begin).as_secs_f64(),
        }
    }

    fn stolen_share(&self) -> f64 {
        1e-3 * self.stolen_ms / self.lasted_s
    }

    fn text(&self) -> String {
        format!(
            "{} of {} goals, {:.1} ms stolen in {:.0} s",
            quantiles_text(&self.took_ms),
            self.took_ms.len(),
            self.stolen_ms,
            self.lasted_s
        )
    }
}

/// Median, p90 and p99 of times, ms.
pub(super) fn quantiles_text(times_ms: &[f64]) -> String {
    let [median, p90, p99] = [0.5, 0.9, 0.99].map(|share| quantile(times_ms, share));
    format!("median {median:.2}, p90 {p90:.2}, p99 {p99:.2} ms")
}

/// Shows the slowest: time until the first set-point and lead, ms, and what else is to be said of each.
pub(super) fn show_slowest(
    report: &mut Report,
    line: &dyn Fn(&str) -> String,
    mut each: Vec<(f64, f64, String)>,
) {
    each.sort_by(|a, b| b.0.total_cmp(&a.0));
    for (took_ms, lead_ms, words) in each.into_iter().take(SLOWEST) {
        let figure = format!("{took_ms:.2} ms: lead {lead_ms:.2}; {words}");
        report.shown(&line("one of the slowest, ms"), figure);
    }
}

/// Shows the times of all goals (when each was given, and ms until its first set-point) by windows, and holds the quietest, all
/// where several are, against the bars.
pub(super) fn show_windows(
    report: &mut Report,
    line: &dyn Fn(&str) -> String,
    took_ms: &[(Instant, f64)],
    stolen: &StolenTimes,
) {
    let length = took_ms.len().div_ceil(WINDOWS).max(1);
    let parts = took_ms.chunks(length);
    let windows: Vec<Window> = parts.map(|part| Window::of(part, stolen)).collect();
    for (index, window) in windows.iter().enumerate() {
        let what = format!("window {index}, goal to first set-point");
        report.shown(&line(&what), window.text());
    }
    let shares = windows.iter().map(Window::stolen_share);
    let least = shares.fold(f64::INFINITY, f64::min);
    let quietest = windows.iter().filter(|it| it.stolen_share() <= least);
    let quietest_ms: Vec<f64> = quietest.flat_map(|it| it.took_ms.clone()).collect();
    for (name, share, bar_ms) in [("median", 0.5, 6.0), ("p99", 0.99, 15.0)] {
        let what = format!(
            "goal to first set-point in the window with the least share of stolen time, {name} ms"
        );
        report.at_most(&line(&what), quantile(&quietest_ms, share), bar_ms);
    }
}
