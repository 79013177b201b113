//! What became of each replan, from what was published alone.

use std::collections::BTreeMap;

use shared_types::codes::{LoopFault, MotionOutcome, Refusal, StopCause};
use shared_types::message::{Cycle, MotionResult};
use tests::listener::Heard;

use super::super::figures::{first_followed, is_on_its_way};

/// From the end of a hold until the loop has found that the robot came to rest, at most, nanoseconds.
const FOUND_WITHIN_NS: i64 = 20_000_000;
/// Holds of the controller that are told beside the end of a motion began so long before at most, nanoseconds.
const TOLD_NS: i64 = 2_000_000_000;

/// A request that found the robot in motion, and its answer.
pub(super) struct Replan {
    pub(super) asked_ns: i64,
    pub(super) answered_ns: i64,
    /// The motion that was published, or why none was.
    pub(super) answer: Result<u32, String>,
    /// Holds of the controller for longer than the robot bears, which then comes to rest by itself, nanoseconds.
    pub(super) long_holds_ns: Vec<[i64; 2]>,
    /// When it was disturbed.
    pub(super) disturbed_ns: Vec<i64>,
}

/// What became of replans.
#[derive(Default)]
pub(super) struct Fates {
    /// Replans by what became of them, and of the motion that was under way where they were refused.
    pub(super) counts: BTreeMap<String, usize>,
    /// Replans whose motion, or the one that was to be left, ended since the controller was held for longer than the robot bears, by what became
    /// of them.
    pub(super) ramped: BTreeMap<String, usize>,
    /// Replans that were neither begun nor refused by name with the old motion going on, in words.
    pub(super) broken: BTreeMap<String, usize>,
    /// Of what was done to the loop: before a request, from it until the switch or the refusal, and later.
    pub(super) disturbed: [usize; 3],
    /// Holds of processes during which a motion was to be left, by the clock.
    pub(super) held_at_switch: usize,
    /// Results that were not heard, by the gaps in their numbers.
    pub(super) results_missed: u64,
    last_result: u64,
}

impl Fates {
    pub(super) fn look(&mut self, replans: &[Replan], heard: &Heard) {
        for result in &heard.results {
            self.results_missed += result.sequence.saturating_sub(self.last_result + 1);
            self.last_result = result.sequence;
        }
        self.look_at_others(replans, heard);
        for replan in replans {
            self.count_disturbances(replan, heard);
            match fate(replan, replans, heard) {
                Ok(Fate::GoesOn(what)) => *self.counts.entry(what).or_default() += 1,
                Ok(Fate::Ramped(what)) => *self.ramped.entry(what).or_default() += 1,
                Err(why) => *self.broken.entry(why).or_default() += 1,
            }
        }
    }

    /// Motions of requests that found the robot at rest go to their ends, too.
    fn look_at_others(&mut self, replans: &[Replan], heard: &Heard) {
        let of_replan = |id: u32| replans.iter().any(|it| it.answer.as_ref() == Ok(&id));
        let stopped = heard.results.iter().filter(|result| {
            result.outcome == MotionOutcome::Stopped.code() && !of_replan(result.trajectory_id)
        });
        for result in stopped.filter(|result| !is_ramped(result, replans)) {
            let what = format!("a motion from rest: {}", with_holds(result, replans));
            *self.broken.entry(what).or_default() += 1;
        }
    }

    fn count_disturbances(&mut self, replan: &Replan, heard: &Heard) {
        let id = replan.answer.as_ref().ok();
        let switched_ns = id.and_then(|id| first_followed(&heard.cycles, *id));
        let bounds = [replan.asked_ns, switched_ns.unwrap_or(replan.answered_ns)];
        for instant in &replan.disturbed_ns {
            let place = bounds.iter().filter(|bound| instant > bound).count();
            self.disturbed[place] += 1;
        }
        let published = heard.motions.iter().find(|it| Some(&it.id) == id);
        let switch_ns = published.filter(|it| it.leaves.is_some());
        if let Some(switch_ns) = switch_ns.map(|it| it.begin_mono_ns) {
            let holds = replan.disturbed_ns.chunks_exact(2);
            let mut holds = holds.map(|hold| hold[0]..hold[1]);
            self.held_at_switch += usize::from(holds.any(|hold| hold.contains(&switch_ns)));
        }
    }
}

/// What became of a replan, in words.
enum Fate {
    /// A motion went on.
    GoesOn(String),
    /// The robot, which no set-point reached for longer than it bears, came to rest by itself.
    Ramped(String),
}

/// Begun; or refused by name, and then what the motion under way did.
fn fate(replan: &Replan, all: &[Replan], heard: &Heard) -> Result<Fate, String> {
    let (refused_ns, why) = match &replan.answer {
        Ok(id) => {
            let leaves = heard.motions.iter().find(|it| it.id == *id);
            let leaves = leaves.ok_or_else(|| format!("trajectory {id} was not heard"))?;
            if first_followed(&heard.cycles, *id).is_some() {
                let how = match leaves.leaves {
                    Some(_) => "begun: joined",
                    None => "begun: the robot had come to rest",
                };
                return end_of(heard, *id, all, how);
            }
            let result = result_of(heard, *id);
            let result = result.ok_or_else(|| format!("trajectory {id} has no result"))?;
            (result.stamp_mono_ns, named(result))
        }
        Err(refusal) => (replan.answered_ns, refusal.clone()),
    };
    let old = under_way(&heard.cycles, refused_ns);
    let old = old.ok_or_else(|| format!("{why}: nothing moved before"))?;
    old_motion(heard, old, refused_ns, all, &why)
}

/// How a motion that was begun in this way ended.
fn end_of(heard: &Heard, id: u32, all: &[Replan], how: &str) -> Result<Fate, String> {
    let result = result_of(heard, id).ok_or_else(|| format!("trajectory {id} has no result"))?;
    match is_whole(result) {
        true => Ok(Fate::GoesOn(how.to_owned())),
        false if is_ramped(result, all) => Ok(Fate::Ramped(how.to_owned())),
        false => Err(format!("{how}; {}", with_holds(result, all))),
    }
}

/// The result of a motion, and the holds of the controller shortly before its end.
fn with_holds(result: &MotionResult, all: &[Replan]) -> String {
    let holds = all
        .iter()
        .flat_map(|replan| replan.disturbed_ns.chunks_exact(2));
    let before = holds.filter(|hold| (0..TOLD_NS).contains(&(result.stamp_mono_ns - hold[0])));
    let ms = |ns: i64| ns as f64 * 1e-6;
    let told = before.map(|hold| {
        format!(
            ", held for {:.1} ms {:.0} ms before",
            ms(hold[1] - hold[0]),
            ms(result.stamp_mono_ns - hold[0])
        )
    });
    named(result) + &told.collect::<String>()
}

/// Whether a motion ended since the robot ramped to rest while the controller was held for longer than it bears.
fn is_ramped(result: &MotionResult, all: &[Replan]) -> bool {
    let mut holds = all.iter().flat_map(|replan| &replan.long_holds_ns);
    let found = |[from, to]: &[i64; 2]| *from..to + FOUND_WITHIN_NS;
    result.fault == LoopFault::RobotRampedToRest.code()
        && holds.any(|hold| found(hold).contains(&result.stamp_mono_ns))
}

/// The motion that was followed last before an instant.
fn under_way(cycles: &[Cycle], before_ns: i64) -> Option<u32> {
    let before = cycles.iter().rev();
    let mut moving = before.filter(|cycle| is_on_its_way(cycle));
    let last = moving.find(|cycle| cycle.stamp_mono_ns <= before_ns)?;
    Some(last.trajectory_id)
}

/// What became of the motion that was to be left when another one was refused for this reason.
fn old_motion(
    heard: &Heard,
    id: u32,
    refused_ns: i64,
    all: &[Replan],
    why: &str,
) -> Result<Fate, String> {
    let missing = || format!("{why}; trajectory {id}, which was to be left, has no result");
    let result = result_of(heard, id).ok_or_else(missing)?;
    let goes_on = |cycle: &Cycle| {
        cycle.trajectory_id == id && is_on_its_way(cycle) && cycle.stamp_mono_ns > refused_ns
    };
    let went_on = heard.cycles.iter().any(goes_on);
    match (is_whole(result), went_on) {
        _ if is_ramped(result, all) => Ok(Fate::Ramped(why.to_owned())),
        (true, true) => Ok(Fate::GoesOn(format!("{why}; the old motion went on"))),
        (true, false) => {
            let named = named(result);
            Ok(Fate::GoesOn(format!(
                "{why}; the old motion had ended: {named}"
            )))
        }
        (false, _) => Err(format!(
            "{why}; the old motion: {}",
            with_holds(result, all)
        )),
    }
}

/// The result of a motion, the last one where an id had several.
fn result_of(heard: &Heard, id: u32) -> Option<&MotionResult> {
    heard
        .results
        .iter()
        .rev()
        .find(|result| result.trajectory_id == id)
}

/// Whether a motion ended where its certificate says that the robot may stand, or went over into another.
pub(crate) fn is_whole(result: &MotionResult) -> bool {
    [MotionOutcome::Reached, MotionOutcome::Joined]
        .map(MotionOutcome::code)
        .contains(&result.outcome)
}

/// A result by its codes.
pub(crate) fn named(result: &MotionResult) -> String {
    let outcome = MotionOutcome::try_from(result.outcome);
    let outcome = outcome.map_or_else(|error| error.to_string(), |outcome| outcome.to_string());
    let known = [
        StopCause::try_from(result.cause)
            .ok()
            .filter(|it| *it != StopCause::None)
            .map(StopCause::text),
        LoopFault::try_from(result.fault)
            .ok()
            .filter(|it| *it != LoopFault::None)
            .map(LoopFault::text),
        Refusal::try_from(result.refusal)
            .ok()
            .filter(|it| *it != Refusal::None)
            .map(Refusal::text),
    ];
    let why: Vec<&str> = known.into_iter().flatten().collect();
    if why.is_empty() {
        return outcome;
    }
    format!("{outcome} ({})", why.join(", "))
}
