//! What queues show: judged from the set-points that were sent, the motions that were published and the results that were told.

use std::collections::BTreeMap;

use shared_types::codes::{LoopState, MotionOutcome};
use shared_types::message::{Cycle, MotionResult};
use tests::brute_force::{Ball, Body, Tendons};
use tests::judge::Verdict;
use tests::listener::{Heard, Published};
use tests::passages::{Position, passages};

use super::figures::is_on_its_way;
use super::queue::{Asked, Queue};
use super::routes::TIP_TOLERANCE_M;

/// A set-point is at a motion's end within this, m: the rounding of sums.
const AT_THE_END_M: f64 = 1e-9;
/// A path time that is told and one that was published are the same within this, s.
const SAME_TIME_S: f64 = 1e-9;
/// Contradictions that are kept in words.
const KEPT: usize = 5;

/// How near a tip was passed.
pub(super) struct Miss {
    pub(super) distance_m: f64,
    /// Time between the two set-points between which it was passed, s.
    pub(super) elapsed_s: f64,
}

/// What queues showed.
#[derive(Default)]
pub(super) struct Figures {
    /// Queues of which something was accepted.
    pub(super) queues: usize,
    pub(super) asked: Asked,
    /// Tips that were accepted.
    pub(super) tips: usize,
    /// Of these, passed in the order in which they were accepted.
    pub(super) passed: usize,
    /// Passed only out of that order.
    pub(super) reordered: Vec<String>,
    /// Not passed at all.
    pub(super) lost: Vec<String>,
    /// Of each passed tip.
    pub(super) misses: Vec<Miss>,
    /// Published motions.
    pub(super) published: usize,
    /// Of these, motions that joined another.
    pub(super) joining: usize,
    /// Published motions of no accepted request, and accepted requests without one.
    pub(super) unaccounted: Vec<String>,
    pub(super) outcomes: BTreeMap<String, usize>,
    /// Published motions without exactly one result, and results of other motions.
    pub(super) miscounted: Vec<String>,
    /// Results that contradict the recording.
    pub(super) contradictions: Vec<String>,
    /// Least clearance of what was executed, m.
    pub(super) clearance_m: Option<f64>,
    /// What was sent to the robot and done by it.
    pub(super) sent: Verdict,
}

impl Figures {
    /// Looks at all that was heard of a queue.
    pub(super) fn look(&mut self, body: &Body, queue: &Queue, heard: &Heard, balls: &[Ball]) {
        self.queues += usize::from(!queue.accepted.is_empty());
        self.look_at_tips(body, queue, heard);
        self.look_at_motions(queue, heard);
        self.look_at_results(body, heard);
        let executed: Vec<(i64, Tendons)> = moving(&heard.cycles).map(stamped).collect();
        let clearance_m = body.least_clearance(&executed, |_| balls).at_least_m();
        let least = self
            .clearance_m
            .map_or(clearance_m, |it| it.min(clearance_m));
        self.clearance_m = Some(least);
    }

    fn look_at_tips(&mut self, body: &Body, queue: &Queue, heard: &Heard) {
        let [begin, end] = queue.between_mono_ns;
        let cycles = heard.cycles.iter();
        let cycles = cycles.filter(|cycle| (begin..=end).contains(&cycle.stamp_mono_ns));
        let cycles: Vec<&Cycle> = cycles.collect();
        let positions: Vec<Position> = cycles
            .iter()
            .map(|cycle| body.tip(&body.explain(&cycle.setpoint_m).configuration))
            .collect();
        let accepted = queue.accepted.iter();
        let tips: Vec<(u32, Position)> = accepted
            .flat_map(|it| it.tips_m.iter().map(|tip| (it.trajectory_id, *tip)))
            .collect();
        let places: Vec<Position> = tips.iter().map(|(_, tip)| *tip).collect();
        let in_order = passages(&positions, &places, TIP_TOLERANCE_M);
        for (index, ((id, tip), passage)) in tips.iter().zip(in_order).enumerate() {
            self.tips += 1;
            if let Some(passage) = passage {
                self.passed += 1;
                let first = passage.at as usize;
                let stamps = [first, (first + 1).min(cycles.len() - 1)];
                let [from, to] = stamps.map(|index| cycles[index].stamp_mono_ns);
                self.misses.push(Miss {
                    distance_m: passage.miss_m,
                    elapsed_s: (to - from) as f64 * 1e-9,
                });
                continue;
            }
            let count = tips.len();
            let name = format!("tip {} of {count}, accepted as trajectory {id}", index + 1);
            match passages(&positions, &[*tip], TIP_TOLERANCE_M)[0] {
                Some(_) => self.reordered.push(name),
                None => self.lost.push(name),
            }
        }
    }

    fn look_at_motions(&mut self, queue: &Queue, heard: &Heard) {
        self.published += heard.motions.len();
        self.joining += heard
            .motions
            .iter()
            .filter(|it| it.leaves.is_some())
            .count();
        let accepted: Vec<u32> = queue.accepted.iter().map(|it| it.trajectory_id).collect();
        let published: Vec<u32> = heard.motions.iter().map(|it| it.id).collect();
        if accepted != published {
            let text = format!("accepted {accepted:?}, published {published:?}");
            self.unaccounted.push(text);
        }
    }

    fn look_at_results(&mut self, body: &Body, heard: &Heard) {
        for motion in &heard.motions {
            let told = heard.results.iter();
            let told: Vec<_> = told.filter(|it| it.trajectory_id == motion.id).collect();
            let [result] = told.as_slice() else {
                let text = format!("trajectory {} has {} results", motion.id, told.len());
                self.miscounted.push(text);
                continue;
            };
            let outcome = outcome(result);
            *self.outcomes.entry(outcome).or_default() += 1;
            if let Some(text) = contradiction(body, result, motion, heard)
                && self.contradictions.len() < KEPT
            {
                self.contradictions.push(text);
            }
        }
        let is_published = |id| heard.motions.iter().any(|motion| motion.id == id);
        let others = heard.results.iter().map(|it| it.trajectory_id);
        let others = others.filter(|id| !is_published(*id));
        let texts = others.map(|id| format!("a result of trajectory {id}, not published"));
        self.miscounted.extend(texts);
    }
}

fn outcome(result: &MotionResult) -> String {
    let outcome = MotionOutcome::try_from(result.outcome);
    let text = outcome.map_or("unknown", MotionOutcome::text);
    match result.reason.text().as_ref() {
        "" => text.to_owned(),
        _ if outcome == Ok(MotionOutcome::Joined) => text.to_owned(),
        reason => format!("{text}: {reason}"),
    }
}

fn moving(cycles: &[Cycle]) -> impl Iterator<Item = &Cycle> {
    cycles.iter().filter(|cycle| is_on_its_way(cycle))
}

fn stamped(cycle: &Cycle) -> (i64, Tendons) {
    (cycle.stamp_mono_ns, cycle.setpoint_m)
}

/// What a recording shows that contradicts the result of a motion; none where they agree.
fn contradiction(
    body: &Body,
    result: &MotionResult,
    motion: &Published,
    heard: &Heard,
) -> Option<String> {
    let id = motion.id;
    let last = heard.cycles.iter().rposition(|it| it.trajectory_id == id);
    let found = match MotionOutcome::try_from(result.outcome) {
        Ok(MotionOutcome::Reached) => not_reached(body, result, motion, &heard.cycles, last),
        Ok(MotionOutcome::Joined) => not_joined(result, heard, last),
        Ok(MotionOutcome::Refused | MotionOutcome::SetAside) => {
            last.map(|_| "cycles followed it".to_owned())
        }
        Ok(MotionOutcome::Stopped) => {
            let stopping =
                |it: &Cycle| it.trajectory_id == id && it.state == LoopState::Stopping.code();
            let stops = heard.cycles.iter().any(stopping);
            (!stops).then(|| "no cycle was stopping on it".to_owned())
        }
        Err(unknown) => Some(unknown.to_string()),
    };
    found.map(|text| format!("trajectory {id}, {}: {text}", outcome(result)))
}

/// Why a motion that is told to be reached was not: its last set-point is its end.
fn not_reached(
    body: &Body,
    result: &MotionResult,
    motion: &Published,
    cycles: &[Cycle],
    last: Option<usize>,
) -> Option<String> {
    let (Some(last), Some(end)) = (last, motion.knots.last()) else {
        return Some("no cycle followed it".to_owned());
    };
    if (result.path_time_s - end.time_s).abs() > SAME_TIME_S {
        return Some(format!("told {} s of {} s", result.path_time_s, end.time_s));
    }
    let wanted = body.tendons(&end.values[0]);
    let distance_m = |cycle: &Cycle| {
        let apart = cycle.setpoint_m.iter().zip(&wanted);
        apart.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    // The cycle that finds it reached holds there, and follows nothing any more.
    let ends = cycles[last..].iter().take(2).map(distance_m);
    let nearest_m = ends.fold(f64::INFINITY, f64::min);
    (nearest_m > AT_THE_END_M)
        .then(|| format!("the last set-point is {nearest_m:.2e} m from its end"))
}

/// Why a motion that is told to be joined by another was not: that one left it there, and was followed after it.
fn not_joined(result: &MotionResult, heard: &Heard, last: Option<usize>) -> Option<String> {
    let successor = heard.motions.iter().find(|it| it.id == result.joined_by);
    let Some((left, at_s)) = successor.and_then(|it| it.leaves) else {
        return Some(format!("trajectory {} leaves none", result.joined_by));
    };
    if left != result.trajectory_id || (at_s - result.path_time_s).abs() > SAME_TIME_S {
        return Some(format!(
            "its successor leaves trajectory {left} at {at_s} s"
        ));
    }
    let next = heard.cycles.iter();
    let next = next
        .enumerate()
        .find(|(_, it)| it.trajectory_id == result.joined_by);
    match (last, next) {
        (Some(last), Some((first, _))) if first == last + 1 => None,
        (last, next) => Some(format!(
            "followed until cycle {last:?}, its successor from {:?} on",
            next.map(|(first, _)| first)
        )),
    }
}
