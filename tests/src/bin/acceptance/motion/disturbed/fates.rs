//! What became of each replan, from what was published alone.

use std::collections::BTreeMap;

use shared_types::codes::{LoopFault, MotionOutcome, Refusal, StopCause};
use shared_types::message::{Cycle, MotionResult};
use tests::listener::Heard;

use super::super::figures::{first_followed, is_on_its_way};

/// A request that found the robot in motion, and its answer.
pub(super) struct Replan {
    pub(super) asked_ns: i64,
    pub(super) answered_ns: i64,
    /// The motion that was published, or why none was.
    pub(super) answer: Result<u32, String>,
    /// Whether the controller was held for longer than the robot bears, which then comes to rest by itself.
    pub(super) outlasts_robot: bool,
    /// When it was disturbed.
    pub(super) disturbed_ns: Vec<i64>,
}

/// What became of replans.
#[derive(Default)]
pub(super) struct Fates {
    /// Replans by what became of them, and of the motion that was under way where they were refused.
    pub(super) counts: BTreeMap<String, usize>,
    /// Replans that were neither begun nor refused by name with the old motion going on, in words.
    pub(super) broken: BTreeMap<String, usize>,
    /// Of what was done to the loop: before a request, until its answer, until the switch, and later.
    pub(super) disturbed: [usize; 4],
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
        for replan in replans {
            self.count_disturbances(replan, &heard.cycles);
            match fate(replan, heard) {
                Ok(fate) => *self.counts.entry(fate).or_default() += 1,
                Err(why) => *self.broken.entry(why).or_default() += 1,
            }
        }
    }

    fn count_disturbances(&mut self, replan: &Replan, cycles: &[Cycle]) {
        let id = replan.answer.as_ref().ok();
        let switched_ns = id.and_then(|id| first_followed(cycles, *id));
        let bounds = [
            replan.asked_ns,
            replan.answered_ns,
            switched_ns.unwrap_or(replan.answered_ns),
        ];
        for instant in &replan.disturbed_ns {
            let place = bounds.iter().filter(|bound| instant > bound).count();
            self.disturbed[place] += 1;
        }
    }
}

/// Begun; or refused by name, and then what the motion under way did.
fn fate(replan: &Replan, heard: &Heard) -> Result<String, String> {
    let (refused_ns, why) = match &replan.answer {
        Ok(id) => {
            let leaves = heard.motions.iter().find(|it| it.id == *id);
            let leaves = leaves.ok_or_else(|| format!("trajectory {id} was not heard"))?;
            if first_followed(&heard.cycles, *id).is_some() {
                let how = match leaves.leaves {
                    Some(_) => "begun: joined",
                    None => "begun: the robot had come to rest",
                };
                return Ok(how.to_owned());
            }
            let result = result_of(heard, *id);
            let result = result.ok_or_else(|| format!("trajectory {id} has no result"))?;
            (result.stamp_mono_ns, named(result))
        }
        Err(refusal) => (replan.answered_ns, refusal.clone()),
    };
    let old = under_way(&heard.cycles, refused_ns);
    let old = old.ok_or_else(|| format!("{why}: nothing moved before"))?;
    let beside_why = |became| format!("{why}; {became}");
    let became = old_motion(heard, old, refused_ns, replan.outlasts_robot);
    became.map(beside_why).map_err(beside_why)
}

/// The motion that was followed last before an instant.
fn under_way(cycles: &[Cycle], before_ns: i64) -> Option<u32> {
    let before = cycles.iter().rev();
    let mut moving = before.filter(|cycle| is_on_its_way(cycle));
    let last = moving.find(|cycle| cycle.stamp_mono_ns <= before_ns)?;
    Some(last.trajectory_id)
}

/// What became of the motion that was to be left when another one was refused: it went on, or the robot, which no set-point reached for longer
/// than it bears, brought it to rest within the limits.
fn old_motion(
    heard: &Heard,
    id: u32,
    refused_ns: i64,
    outlasts_robot: bool,
) -> Result<String, String> {
    let result = result_of(heard, id)
        .ok_or_else(|| format!("trajectory {id}, which was to be left, has no result"))?;
    let goes_on = |cycle: &Cycle| {
        cycle.trajectory_id == id && is_on_its_way(cycle) && cycle.stamp_mono_ns > refused_ns
    };
    let went_on = heard.cycles.iter().any(goes_on);
    let is_ramped = outlasts_robot && result.fault == LoopFault::RobotRampedToRest.code();
    match (is_whole(result), went_on) {
        _ if is_ramped => Ok("the robot, without set-points, came to rest by itself".to_owned()),
        (true, true) => Ok("the old motion went on".to_owned()),
        (true, false) => Ok(format!("the old motion had ended: {}", named(result))),
        (false, _) => Err(format!("the old motion: {}", named(result))),
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
