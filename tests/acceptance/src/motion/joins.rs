//! Replans at random instants: continuity, limits, contacts, and what they win over stopping first.

use tests::judge::{ALLOWED_USE, SENT_USE};
use tests::world::{Settings, shipped};

use super::figures::{Figures, is_later, quantile};
use super::replan_run::{Population, run as replan};
use super::setpoints::{no_offences, within_limits};
use crate::report::Report;
use crate::scale::Scale;
use crate::spread::median;

/// What is later by less cannot be told from equally early, ms.
const LEFT_OPEN_MS: f64 = 1e-3;

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
    what_was_asked(report, &line, figures);
    let name = line("set-points: jerk by differences ÷ limit, while motions are followed");
    report.at_most(&name, figures.sent.jerk, ALLOWED_USE);
    report.none_of(
        &line("joined motions that ended otherwise than reached or joined by another"),
        &figures.ended_otherwise,
    );
    show_curves(report, &line, figures);
    wins(
        report,
        &line(
            "time won over a stop at the switch and the fastest of ten motions to the same goal configuration",
        ),
        figures,
    );
}

/// The population, and that every request of it is accounted for.
pub(super) fn what_was_asked(
    report: &mut Report,
    line: &dyn Fn(&str) -> String,
    figures: &Figures,
) {
    let counts = format!(
        "{} requests found the robot in motion, by the cycle at that time, of {} in all (ten candidates, deadline 1 s; tips of configurations with \
         room; the next one after no time to the whole motion); {} motions joined another, {} of them were begun, {} began at rest, since it had \
         come to rest meanwhile; {} were joined or planned again for a missed switch; the switch was chosen again before anything was published, by what was then to be done: {:?}; \
         refused in motion: {:?}; refused at rest: {:?}; {} scenes in which the robot had room, of {} drawn",
        figures.in_motion,
        figures.requests,
        figures.joined,
        figures.switched,
        figures.began_at_rest,
        figures.made_again.len(),
        figures.chosen_again,
        figures.refusals,
        figures.refused_at_rest,
        figures.scenes,
        figures.scenes_drawn
    );
    report.shown(&line("what was asked for"), counts);
    figures.faults.show(report, line);
    let refused: usize = figures.refusals.values().sum();
    let in_motion = figures.published.values().filter(|it| it.in_motion);
    let account = format!(
        "{} in motion = {refused} refused + {} published, of which {} were not heard",
        figures.in_motion,
        in_motion.clone().count(),
        figures.unheard
    );
    report.check(
        &line("every request in motion is accounted for"),
        account,
        "all, each published motion heard",
        figures.in_motion == refused + in_motion.count() && figures.unheard == 0,
    );
}

/// Continuity, limits and contacts.
pub(super) fn show_curves(report: &mut Report, line: &dyn Fn(&str) -> String, figures: &Figures) {
    let [planned, executed] = figures.clearance_m;
    let is_looked_at = figures.joined > 0 && planned.is_finite() && executed.is_finite();
    report.check(
        &line("joined motions that were looked at"),
        figures.joined.to_string(),
        "> 0, among balls, and executed ones",
        is_looked_at,
    );
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
        "median {:.3}, p10 {:.3}, p90 {:.3} of the shortest stop ({} motions that stop on their way count 0), by the time in which the slowest tendon can come to rest, which is a lower \
         bound, and by a linear program where that is too short; by the planner's own stop median {:.3}; {} compared, {} begun at rest or not at all and {refused} refused count 0",
        at(0.5),
        at(0.1),
        at(0.9),
        figures.stopped_between,
        median(&figures.won_by_own_stop),
        figures.won_by_own_stop.len(),
        figures.won.len() - figures.won_by_own_stop.len(),
    );
    beside_other_stops(report, name, figures);
    let is_known = won.iter().all(|won| won.is_finite());
    report.check(name, figure, ">= 0.35", is_known && at(0.5) >= 0.35);
    let name_of = |what: &str| format!("{name}: {what}");
    report.at_most(
        &name_of("replans without a reference"),
        figures.without_reference as f64,
        0.0,
    );
    let worst = won.first().copied().unwrap_or(f64::NAN);
    let truncated = figures.later_truncated;
    let by_own: Vec<f64> = figures
        .won_by_own_stop
        .iter()
        .copied()
        .filter(is_later)
        .collect();
    let figure = format!(
        "{later} of {}, the worst {worst:.3}; {truncated} of them of plans that their deadline cut short; by the planner's own stop {}, \
         the worst {:.5}",
        won.len(),
        by_own.len(),
        by_own.iter().copied().fold(0.0, f64::min)
    );
    report.check(&format!("{name}: arrivals later"), figure, "0", later == 0);
}

/// Beside stops that are solved for, and a robot that brakes at once.
fn beside_other_stops(report: &mut Report, name: &str, figures: &Figures) {
    let solved = figures.stops_solved.iter().take(20).cloned();
    report.shown(
        &format!("{name}: stops solved for (slowest tendon, shortest, the planner's own)"),
        format!(
            "{}: {}",
            figures.stops_solved.len(),
            solved.collect::<Vec<_>>().join("; ")
        ),
    );
    let from_the_request = &figures.won_from_the_request;
    report.at_most(
        &format!(
            "{name}: later at most of the {} that are not earlier than a stop shorter by one step of the linear program, ms",
            figures.left_open_ms.len()
        ),
        figures.left_open_ms.iter().copied().fold(0.0, f64::max),
        LEFT_OPEN_MS,
    );
    report.shown(
        &format!("{name}: counted from the request, beside a robot that brakes at once and then knows its motion at once"),
        format!(
            "median {:.3}, p10 {:.3} of the stop of the slowest tendon; later in {} of {}",
            median(from_the_request),
            quantile(from_the_request, 0.1),
            from_the_request.iter().filter(|won| is_later(won)).count(),
            from_the_request.len()
        ),
    );
}

fn bending_limit_rad() -> f64 {
    let robot = shipped("robots/unit.toml");
    robot["bending_limit_rad"].as_float().unwrap_or(f64::NAN)
}
