//! Random queues in scenes: no goal lost, none reordered; a result of every motion on the wire.

use super::figures::quantile;
use super::queue_figures::Figures;
use super::queue_run::run as carry_out;
use super::replan_run::Population;
use super::setpoints::{Line, no_offences, within_limits};
use crate::report::Report;
use crate::scale::Scale;
use tests::world::Settings;

/// Queues ten times as fast, and real ones.
pub(super) fn run(report: &mut Report, scale: Scale) {
    let command = "requests with several tips, and appended ones, to planner-daemon";
    let bulk = Population {
        settings: Settings::ten_times_as_fast(),
        time_factor: 10.0,
        count: scale.pick(40, 1000),
    };
    let real = Population {
        settings: Settings::default(),
        time_factor: 1.0,
        count: scale.pick(2, 20),
    };
    for (name, population) in [("ten times as fast", bulk), ("real", real)] {
        report.group(&format!("queues, {name}"), command, |report| {
            show(report, name, &carry_out(&population)?);
            Ok(())
        });
    }
}

fn show(report: &mut Report, name: &str, figures: &Figures) {
    let line = |what: &str| format!("random queues in scenes, {name}: {what}");
    let asked = &figures.asked;
    let counts = format!(
        "{} queues of 2 to 6 tips in {} scenes in which the robot had room, of {} drawn, by {} requests (four candidates, deadline 0.5 s), {} queues in one request, {} requests appended in motion; \
         {} requests refused with {} tips, {} of them the first of a queue: {:?}",
        figures.queues,
        asked.scenes,
        asked.scenes_drawn,
        asked.requests,
        asked.whole,
        asked.appended_in_motion,
        asked.refused.values().sum::<usize>(),
        asked.tips_refused,
        asked.not_begun,
        asked.refused
    );
    let asks_in_motion = asked.appended_in_motion > 0;
    report.check(
        &line("what was asked for"),
        counts,
        "some appended in motion",
        asks_in_motion,
    );
    let passed = format!(
        "{} of {}; {}",
        figures.passed,
        figures.tips,
        misses(figures)
    );
    let what = line("accepted tips passed within 0.01 m by the set-points, in the order accepted");
    report.check(&what, passed, "all", figures.passed == figures.tips);
    none(report, &line("accepted tips lost"), &figures.lost);
    none(report, &line("accepted tips reordered"), &figures.reordered);
    let what = line("queues whose published motions are not those accepted, in their order");
    none(report, &what, &figures.unaccounted);
    show_sent(report, &line, figures);
    show_results(report, name, figures);
}

/// How near the tips were passed.
fn misses(figures: &Figures) -> String {
    let distances: Vec<f64> = figures.misses.iter().map(|miss| miss.distance_m).collect();
    let worst = figures.misses.iter();
    let worst = worst.max_by(|a, b| a.distance_m.total_cmp(&b.distance_m));
    format!(
        "missed by {:.1e} m in the median, p99 {:.1e} m, {:.1e} m at most, there between set-points {:.1} ms apart",
        quantile(&distances, 0.5),
        quantile(&distances, 0.99),
        quantile(&distances, 1.0),
        worst.map_or(f64::NAN, |miss| 1e3 * miss.elapsed_s)
    )
}

/// A check that there is none of something.
fn none(report: &mut Report, name: &str, found: &[String]) {
    let figure = format!("{} {:?}", found.len(), found.first());
    report.check(name, figure, "0", found.is_empty());
}

fn show_sent(report: &mut Report, line: Line, figures: &Figures) {
    let sent = &figures.sent;
    within_limits(report, line, sent);
    no_offences(report, line, sent);
    let clearance_m = figures.clearance_m.unwrap_or(f64::NAN);
    let name = line("least clearance of what was executed, dense sampling");
    let figure = format!("{clearance_m:.5} m");
    let is_clear = clearance_m >= 0.0 && clearance_m.is_finite();
    report.check(&name, figure, ">= 0, with balls there", is_clear);
}

fn show_results(report: &mut Report, name: &str, figures: &Figures) {
    let line =
        |what: &str| format!("a result of every motion of queues on the wire, {name}: {what}");
    let all: usize = figures.outcomes.values().sum();
    let counts = format!(
        "{all} of {} published ({} join another): {:?}; {:?}",
        figures.published,
        figures.joining,
        figures.outcomes,
        figures.miscounted.first()
    );
    let is_whole = figures.miscounted.is_empty() && all == figures.published;
    report.check(&line("exactly one each"), counts, "all", is_whole);
    let name = line("results that contradict what was sent and published");
    none(report, &name, &figures.contradictions);
}
