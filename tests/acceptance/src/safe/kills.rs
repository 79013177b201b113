//! Processes killed and stopped, and threads held, at random instants.

use std::collections::BTreeMap;

use tests::disturbance::Kind;
use tests::judge::{ALLOWED_USE, SENT_USE, Verdict};
use tests::kills::{READY_WITHIN, Survival, disturb};
use tests::stack::{Part, Stack};
use tests::supervision::Watched;
use tests::world::Settings;

use crate::report::Report;
use crate::scale::Scale;

/// So many balls in one way of disturbing one process find at least one motion that goes on. (One disturbance in five is a hold shorter
/// than the 20 ms after which a process counts as lost, and changes nothing.) The quick form puts two balls in each way.
const ENOUGH_BALLS: usize = 6;

pub(crate) fn run(report: &mut Report, scale: Scale) {
    let command = "acceptance safe, kills";
    report.group("kills and stops", command, |report| {
        let mut stack = Stack::running(&Settings::default())?;
        let count = scale.pick(54, 500);
        let survival = disturb(&mut stack, &Kind::ALL, count, 1)?;
        premises(report, &survival, count);
        limits(report, &survival);
        supervision(report, &survival);
        stuck(report, &survival);
        Ok(())
    });
}

/// `3 × this, 2 × that`.
pub(crate) fn listed(counts: &BTreeMap<String, usize>) -> String {
    let each = counts
        .iter()
        .map(|(what, count)| format!("{count} × {what}"));
    each.collect::<Vec<_>>().join(", ")
}

fn total(counts: &BTreeMap<String, usize>) -> usize {
    counts.values().sum()
}

fn premises(report: &mut Report, survival: &Survival, count: usize) {
    let disturbances = &survival.disturbances;
    report.check(
        "disturbances: SIGKILL, SIGSTOP, single threads held by ptrace",
        listed(disturbances),
        &format!("{count}, each of 3 ways with each of 3 processes"),
        total(disturbances) == count && disturbances.len() == 9,
    );
    phases(report, survival, &Kind::ALL, count);
    let held = &survival.threads_held;
    let seen = &survival.threads_seen;
    let name = format!("threads held at least once ({})", listed(held));
    let hit = seen.iter().filter(|name| held.contains_key(*name)).count();
    // Threads are held in turn, but one that starts has not all of them yet.
    let holds = count / 9;
    let wanted = if holds >= 2 * seen.len() {
        seen.len()
    } else {
        holds
    };
    report.check(
        &name,
        format!("{hit} of {}", seen.len()),
        &format!(">= {wanted}"),
        hit >= wanted,
    );
}

/// What went on when the processes were disturbed; also for a suite that only kills.
///
/// No combination is impossible: a process that starts has its first thread at once, so that one can be held; a process that dies
/// while another one's request is planned is disturbed while planning.
pub(crate) fn phases(report: &mut Report, survival: &Survival, kinds: &[Kind], count: usize) {
    let phases = &survival.phases;
    let in_phase = |word: &str| -> usize {
        let those = phases.iter().filter(|(phase, _)| phase.contains(word));
        those.map(|(_, count)| count).sum()
    };
    let wanted = Part::ALL.into_iter().flat_map(|part| {
        let name = part.program();
        let starting = format!("{name} while starting {name}");
        let others = ["planning", "resting", "moving"].map(|word| format!("{name} while {word}"));
        std::iter::once(starting).chain(others)
    });
    let missing: Vec<String> = wanted
        .flat_map(|doing| kinds.iter().map(move |kind| format!("{kind:?} of {doing}")))
        .filter(|combination| !phases.contains_key(combination))
        .collect();
    report.shown("what went on at their instants", listed(phases));
    report.none_of(
        "ways × processes × (starting, planning, resting, moving) that were not tried, as seen from outside",
        &missing,
    );
    let moving = in_phase("while moving");
    let name = "disturbances of a moving robot";
    report.check(name, moving.to_string(), ">= a fifth", moving * 5 >= count);
}

/// What the listener did not hear, and nobody could judge.
fn unheard(report: &mut Report, survival: &Survival) {
    let verdict = &survival.verdict;
    let heard = verdict.setpoints + verdict.robot_states;
    report.check(
        "set-points, robot states and cycles that were not heard between two that were",
        format!("{:?} of {heard}", verdict.lost),
        "0",
        verdict.lost == [0; 3] && heard > 0,
    );
    report.check(
        "set-points, robot states and cycles that were not heard before the first one of a process that had begun anew",
        format!("{:?}", verdict.first_unheard),
        "0",
        verdict.first_unheard == [0; 3],
    );
    let last = verdict.last_unheard.to_string();
    report.shown(
        "last set-points of killed controllers that were not heard",
        last,
    );
    let each = verdict.losses.join("; ");
    report.shown("each of these losses; steps are judged across them", each);
    let unheard = verdict.lost[0] + verdict.first_unheard[0] + verdict.last_unheard;
    report.check(
        "states of a following robot whose set-point was not heard",
        verdict.unmatched.to_string(),
        "0, or the 20 ms of states that may follow each one not heard",
        verdict.unmatched as u64 <= 20 * unheard,
    );
}

/// Steps from each set-point or reference to the next, beside the limits.
fn steps(report: &mut Report, verdict: &Verdict) {
    for (name, used) in [
        ("from set-point to set-point", &verdict.sent),
        (
            "from the robot's reference to the set-point that takes hold of it, over restarts",
            &verdict.taken,
        ),
        (
            "robot's reference in ramps, restarts and taking hold",
            &verdict.unled,
        ),
    ] {
        let name_of = |what: &str| format!("{name}: {what}, {} pairs", used.pairs);
        let position = name_of("position step ÷ (velocity limit × time between them)");
        report.at_most(&position, used.position, ALLOWED_USE);
        let velocity = name_of("velocity step ÷ (acceleration limit × time between them)");
        report.at_most(&velocity, used.velocity, ALLOWED_USE);
    }
}

/// What the robot was sent and made of it; also for a suite that only kills.
pub(crate) fn limits(report: &mut Report, survival: &Survival) {
    let verdict = &survival.verdict;
    unheard(report, survival);
    report.at_most(
        "set-points: velocity over the shipped limit",
        verdict.velocity,
        SENT_USE,
    );
    report.at_most(
        "set-points: acceleration over the shipped limit",
        verdict.acceleration,
        SENT_USE,
    );
    steps(report, verdict);
    let name = "robot's reference from the set-point that it follows, m";
    report.at_most(name, verdict.reference_error_m, 1e-9);
    let name = "what went beyond a limit";
    report.none_of(name, &verdict.offences);
    let pairs = [verdict.sent, verdict.taken, verdict.unled].map(|used| used.pairs);
    let figure = format!(
        "{} of processes, {} of set-points; {pairs:?} pairs",
        verdict.restarts, verdict.holds_taken
    );
    report.check(
        "restarts over which that was looked at, and pairs of each kind",
        figure,
        "some of each",
        verdict.restarts > 0 && verdict.holds_taken > 0 && !pairs.contains(&0),
    );
    let faults = verdict.faults;
    let name = "robot's states in fault (a set-point broke a rule)";
    report.check(name, faults.to_string(), "0", faults == 0);
}

/// Who stops for a ball; also for a suite that only kills.
pub(crate) fn supervision(report: &mut Report, survival: &Survival) {
    let watched = &survival.watched;
    let mut times = watched.reactions_ms.clone();
    times.sort_by(f64::total_cmp);
    let worst = times.last().copied().unwrap_or_default();
    report.check(
        "balls put in the way of disturbed motions",
        format!(
            "{}, {} of them with somebody who had to stop; worst {worst:.1} ms",
            watched.balls, watched.had_to_stop
        ),
        "at least a quarter had to be stopped",
        watched.had_to_stop * 4 >= watched.balls && watched.had_to_stop > 0,
    );
    each_way(report, watched);
    report.none_of(
        "not stopped or at rest 100 ms after the first fresh state (of a killed daemon's motion: after the first state that the next \
         daemon can hear, or at rest before)",
        &watched.late,
    );
    anew(report, survival);
}

/// That somebody had to stop in each way in which a motion can go on: a killed controller executes nothing any more.
fn each_way(report: &mut Report, watched: &Watched) {
    let dead = format!("{:?} {}", Kind::Kill, Part::Controller.program());
    let tried = watched.ways.iter();
    let tried = tried.filter(|(way, [balls, _])| **way != dead && *balls >= ENOUGH_BALLS);
    let idle: Vec<String> = tried
        .filter(|(_, [_, had_to_stop])| *had_to_stop == 0)
        .map(|(way, [balls, _])| format!("{way}: 0 of {balls}"))
        .collect();
    let each = watched.ways.iter();
    let each = each.map(|(way, [balls, stopped])| format!("{way}: {stopped} of {balls}"));
    let each: Vec<String> = each.collect();
    let name = format!(
        "ways with {ENOUGH_BALLS} balls or more of which none found somebody who had to stop ({})",
        each.join(", ")
    );
    report.none_of(&name, &idle);
}

/// Balls in motions that were made after a daemon was killed, stopped or held, and that it or its successor has to stop.
fn anew(report: &mut Report, survival: &Survival) {
    let watched = &survival.watched_anew;
    let mut times = watched.reactions_ms.clone();
    times.sort_by(f64::total_cmp);
    let worst = times.last().copied().unwrap_or_default();
    let (stopped, balls) = (watched.had_to_stop, watched.balls);
    report.check(
        "balls put in the way of motions made after a daemon was killed, stopped or held, in whatever it did",
        format!("{balls}, in {stopped} of them a motion was under way; worst {worst:.1} ms"),
        "one after each, a motion under way in each",
        stopped == balls && balls > 0 && balls == survival.daemons_disturbed(),
    );
    report.none_of(
        "not stopped or at rest 100 ms after the ball was published",
        &watched.late,
    );
}

/// Whether everything went on; also for a suite that only kills.
pub(crate) fn stuck(report: &mut Report, survival: &Survival) {
    let name = format!(
        "all ready within {} s, and a motion planned, executed and reached when first asked for",
        READY_WITHIN.as_secs()
    );
    report.all_of(&name, survival.recovered, survival.rounds);
    report.none_of("those not so", &survival.failures);
    report.shown(
        "longest time until ready, s",
        format!("{:.2}", survival.ready_s),
    );
    let again = &survival.asked_again;
    let name = "motions refused or cut short and asked for again, by cause";
    let figure = format!("{} {}", total(again), listed(again));
    report.check(name, figure.trim().to_owned(), "0", again.is_empty());
    report.shown("faults latched, each reset once", listed(&survival.faults));
    report.shown(
        "disturbed motions that did not reach their end",
        listed(&survival.cut_short),
    );
    report.at_most(
        "tip error of the motions after, m",
        survival.tip_error_m,
        0.01,
    );
    let (looked_for, seen) = survival.ramps;
    report.check(
        "ramps to rest seen after the controller was killed in motion",
        format!("{seen} of {looked_for}"),
        "all, and one at least",
        seen == looked_for && looked_for > 0,
    );
}
