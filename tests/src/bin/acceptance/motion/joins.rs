//! Replans at random instants: continuity, limits, contacts, and what they win over stopping first.

use tests::judge::SENT_USE;
use tests::world::{Settings, shipped};

use super::figures::{Figures, is_later};
use super::replan_run::{Population, run as replan};
use super::setpoints::{no_offences, within_limits};
use crate::report::Report;
use crate::scale::Scale;

/// Bulk replans ten times as fast, and real ones.
pub(super) fn run(report: &mut Report, scale: Scale) {
    let command = "requests to planner-daemon from a moving robot";
    let bulk = Population {
        settings: Settings::ten_times_as_fast(),
        time_factor: 10.0,
        count: scale.pick(400, 10_000),
    };
    report.group("replans, ten times as fast", command, |report| {
        show(report, "ten times as fast", &replan(&bulk)?);
        Ok(())
    });
    let real = Population {
        settings: Settings::default(),
        time_factor: 1.0,
        count: scale.pick(20, 100),
    };
    report.group("replans, real", command, |report| {
        show(report, "real", &replan(&real)?);
        Ok(())
    });
}

/// The lines of a population.
pub(super) fn show(report: &mut Report, name: &str, figures: &Figures) {
    let line = |what: &str| format!("replans, {name}: {what}");
    let counts = format!(
        "{} requests found the robot in motion, of {} in all; {} motions joined another, {} of them were begun, {} began at rest, since it had come to \
         rest meanwhile; {} were planned again for a missed switch; refused in motion: {:?}; \
         refused at rest: {:?}; {} scenes in which the robot had no room were passed over",
        figures.in_motion,
        figures.requests,
        figures.joined,
        figures.switched,
        figures.began_at_rest,
        figures.made_again.len(),
        figures.refusals,
        figures.refused_at_rest,
        figures.scenes_passed_over
    );
    report.shown(&line("what was asked for"), counts);
    show_curves(report, &line, figures);
    wins(
        report,
        &line(
            "time won over a stop at the switch and the fastest of ten motions to the same goal configuration",
        ),
        figures,
    );
}

/// Continuity, limits and contacts.
pub(super) fn show_curves(report: &mut Report, line: &dyn Fn(&str) -> String, figures: &Figures) {
    for (difference, unit) in figures.discontinuity.iter().zip(["rad", "rad/s", "rad/s²"]) {
        let what = format!("largest difference of both curves at the switch, {unit}");
        report.at_most(&line(&what), *difference, 1e-9);
    }
    let kinds = ["velocity", "acceleration", "jerk"];
    for (used, kind) in figures.limits.iter().zip(kinds) {
        let what = format!("largest use of the {kind} limit by joined motions, dense sampling");
        report.at_most(&line(&what), *used, SENT_USE);
    }
    within_limits(report, &line, &figures.sent);
    no_offences(report, &line, &figures.sent);
    let bending = bending_limit_rad() + 1e-6;
    let largest = figures.largest_bending_rad;
    report.at_most(
        &line("largest bending of joined motions, rad"),
        largest,
        bending,
    );
    let [planned, executed] = figures.clearance_m;
    let touch = |clearance: f64| format!("{clearance:.5} m");
    report.check(
        &line("least clearance of joined motions, dense sampling"),
        touch(planned),
        ">= 0",
        planned >= 0.0,
    );
    report.check(
        &line("least clearance of what was executed, dense sampling"),
        touch(executed),
        ">= 0",
        executed >= 0.0,
    );
}

/// Against stop-then-go.
fn wins(report: &mut Report, name: &str, figures: &Figures) {
    // A replan that is refused wins nothing.
    let refused: usize = figures.refusals.values().sum();
    let mut won = figures.won.clone();
    won.extend(std::iter::repeat_n(0.0, refused));
    won.sort_by(f64::total_cmp);
    let at = |part: f64| {
        won.get((part * won.len() as f64) as usize)
            .copied()
            .unwrap_or(f64::NAN)
    };
    let later = won.iter().filter(|won| is_later(won)).count();
    let figure = format!(
        "median {:.3}, p10 {:.3}, p90 {:.3} of the shortest stop; {} compared, {} without a reference, {refused} refused count 0",
        at(0.5),
        at(0.1),
        at(0.9),
        figures.won.len(),
        figures.without_reference
    );
    report.check(name, figure, ">= 0.35", at(0.5) >= 0.35);
    let worst = won.first().copied().unwrap_or(f64::NAN);
    let truncated = figures.later_truncated;
    let figure = format!(
        "{later} of {}, the worst {worst:.3}; {truncated} of them of plans that their deadline cut short",
        won.len()
    );
    report.check(&format!("{name}: arrivals later"), figure, "0", later == 0);
}

fn bending_limit_rad() -> f64 {
    let robot = shipped("robots/unit.toml");
    robot["bending_limit_rad"].as_float().unwrap_or(f64::NAN)
}
