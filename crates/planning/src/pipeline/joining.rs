//! Motions from rest are joined to the braking of a robot in motion: the fastest first, which is told before the others are joined.

use crate::motion::constraints::MotionConstraints;
use crate::path::waypoints::straight_path;
use crate::pipeline::braking::Braking;
use crate::pipeline::selection::select;
use crate::plan::{Candidate, Draw, Failure, Plan};
use codes::{Selection, Source, Stage};
use pcc_model::Configuration;
use rayon::prelude::*;
use std::cmp::Ordering;
use std::mem;

/// Candidates that are joined at once, as long as one of them may be selected.
const AT_ONCE: usize = 2;
/// Share of the braking by which a joined motion is expected to be faster than the motion from rest at most: in 300 replans no candidate that
/// was left out by this, or by none of it, became the fastest.
const LARGEST_GAIN: f64 = 0.25;

/// Joins motions to a braking.
#[derive(Clone, Copy)]
pub(super) struct Joining<'a> {
    pub(super) braking: &'a Braking<'a>,
    /// What motions from where the robot then rests must keep.
    pub(super) after: &'a MotionConstraints<'a>,
}

/// Straight segments to goal configurations, joined to a braking before other paths are planned.
#[derive(Default)]
pub(super) struct JoinedSegments {
    segments: Vec<Segment>,
    /// Whether no motion to any other goal configuration is expected to be faster than the fastest of these.
    is_settled: bool,
}

/// A straight segment as a draw, its motion joined to a braking.
struct Segment {
    draw: Draw,
    joined: Candidate,
}

/// The draw of a motion, and the motion joined to the braking.
type Joined = (usize, Result<Candidate, Failure>);

impl JoinedSegments {
    /// The fastest motion of the request, where it is known: to the same goal configuration no path is faster than a straight segment
    /// (docs/robot.md "Tendons").
    pub(super) fn selected(&self) -> Option<&Candidate> {
        let joined = self.segments.iter().map(|segment| &segment.joined);
        let joined = joined.filter(|_| self.is_settled);
        joined.min_by(|a, b| a.metrics.duration_s.total_cmp(&b.metrics.duration_s))
    }
}

impl Joining<'_> {
    /// Joins straight segments to the goal configurations of the first draws, until the fastest motion is known or cannot be.
    pub(super) fn segments(&self, goals: &[Configuration]) -> JoinedSegments {
        let start = self.braking.motion.end();
        let least_s = |goal: &Configuration| self.after.least_duration_s(&[start, *goal]);
        let mut order: Vec<(usize, f64)> = goals.iter().map(least_s).enumerate().collect();
        order.sort_by(|a, b| a.1.total_cmp(&b.1));
        let mut segments: Vec<Segment> = Vec::new();
        // From rest, motions that take longer than this are not expected to be selected, and others than segments take at least that long.
        let (mut longest_s, mut others_s) = (f64::INFINITY, f64::INFINITY);
        for round in order.chunks(AT_ONCE) {
            if round[0].1 > longest_s || others_s < f64::INFINITY {
                break;
            }
            let segment = |&(draw, _): &(usize, f64)| self.segment(draw, &goals[draw], longest_s);
            let tried: Vec<_> = round.par_iter().map(segment).collect();
            for (segment, (_, least_s)) in tried.into_iter().zip(round) {
                match segment {
                    Ok(segment) => {
                        let joined_s = segment.joined.metrics.duration_s;
                        longest_s = longest_s.min(joined_s + self.largest_gain_s());
                        segments.push(segment);
                    }
                    Err(Failure::Slower) => {}
                    Err(_) => others_s = others_s.min(*least_s),
                }
            }
        }
        JoinedSegments {
            is_settled: others_s > longest_s,
            segments,
        }
    }

    /// The straight segment to a configuration as a motion joined to the braking; [`Failure::Slower`] where it takes longer than
    /// `longest_s` from rest.
    fn segment(
        &self,
        draw: usize,
        goal: &Configuration,
        longest_s: f64,
    ) -> Result<Segment, Failure> {
        if (self.after.interrupt)() {
            return Err(Failure::Truncated);
        }
        let path = straight_path(&self.braking.motion.end(), goal);
        let from_rest = self.after.time(&path)?;
        if from_rest.duration() > longest_s {
            return Err(Failure::Slower);
        }
        let from_rest = self.after.certified(from_rest)?;
        let from_rest = Candidate::of(draw, Source::StraightLine, &from_rest);
        let joined = self.braking.candidate(&from_rest)?;
        let draw = Draw {
            sampled: Some(path.clone()),
            path: Some(path),
            source: Source::StraightLine,
            outcome: Ok(joined.certified()),
        };
        Ok(Segment { draw, joined })
    }

    /// The duration by which a joined motion is expected to be shorter than the motion from rest at most, s.
    fn largest_gain_s(&self) -> f64 {
        LARGEST_GAIN * self.braking.motion.duration()
    }

    /// A plan from rest with every motion joined to the braking, and the figures of the whole motions; `segments` take the place of the
    /// paths to their goal configurations. Where these do not tell which motion is the fastest, `selected` is told before the others are
    /// joined.
    pub(super) fn plan(
        &self,
        mut plan: Plan,
        segments: JoinedSegments,
        selected: Option<&(dyn Fn(Candidate) + Sync)>,
    ) -> Plan {
        let mut stages = plan.stages;
        stages.measure(Stage::Select, || self.join(&mut plan, segments, selected));
        plan.stages = stages;
        plan
    }

    fn join(
        &self,
        plan: &mut Plan,
        segments: JoinedSegments,
        selected: Option<&(dyn Fn(Candidate) + Sync)>,
    ) {
        let is_settled = segments.is_settled;
        let mut joined: Vec<Joined> = Vec::with_capacity(plan.draws.len());
        for Segment { draw, joined: it } in segments.segments {
            plan.draws[it.draw] = draw;
            joined.push((it.draw, Ok(it)));
        }
        let mut from_rest = mem::take(&mut plan.candidates);
        from_rest.retain(|it| joined.iter().all(|(draw, _)| *draw != it.draw));
        from_rest.sort_by(in_order_of_selection);
        let others = if is_settled {
            self.join_all(&from_rest, rayon::current_num_threads())
        } else {
            let first = self.join_fastest(&from_rest, &mut joined);
            let tell_fastest = || {
                let segment = self.straighten_fastest(&mut joined);
                if let (Some(tell), Some(candidate)) = (selected, select_of(&joined)) {
                    tell(candidate);
                }
                segment
            };
            // The selected motion is published meanwhile, and its way to the loop needs a processor.
            let workers = rayon::current_num_threads() - 1;
            let join_others = || self.join_all(&from_rest[first..], workers);
            let (segment, others) = rayon::join(tell_fastest, join_others);
            if let Some(segment) = segment {
                plan.draws[segment.joined.draw] = segment.draw;
            }
            others
        };
        joined.extend(others);
        joined.sort_by_key(|(draw, _)| *draw);
        for (draw, joined) in &joined {
            let outcome = joined.as_ref().map(Candidate::certified);
            plan.draws[*draw].outcome = outcome.map_err(|failure| *failure);
            plan.truncated |= joined.as_ref().err() == Some(&Failure::Truncated);
        }
        plan.candidates = joined.into_iter().filter_map(|it| it.1.ok()).collect();
    }

    /// Joins motions in their order until no other one is expected to become faster than the fastest joined one; returns how many.
    fn join_fastest(&self, from_rest: &[Candidate], joined: &mut Vec<Joined>) -> usize {
        let mut count = 0;
        for round in from_rest.chunks(AT_ONCE) {
            let fastest_s = joined.iter().map(duration_s).fold(f64::INFINITY, f64::min);
            if round[0].metrics.duration_s > fastest_s + self.largest_gain_s() {
                break;
            }
            let motions = round.par_iter().map(|from_rest| self.outcome(from_rest));
            joined.par_extend(motions);
            count += round.len();
        }
        count
    }

    /// Joins motions that are not selected, on so many workers, until the request is interrupted.
    fn join_all(&self, from_rest: &[Candidate], workers: usize) -> Vec<Joined> {
        let joined = |from_rest: &Candidate| {
            if (self.after.interrupt)() {
                return (from_rest.draw, Err(Failure::Truncated));
            }
            self.outcome(from_rest)
        };
        let of_a_worker = from_rest.len().div_ceil(workers.max(1)).max(1);
        let from_rest = from_rest.par_iter().with_min_len(of_a_worker);
        from_rest.map(joined).collect()
    }

    fn outcome(&self, from_rest: &Candidate) -> Joined {
        (from_rest.draw, self.braking.candidate(from_rest))
    }

    /// Puts the straight segment, corrected where it is not clear, in the place of the path of the fastest motion, where its motion is faster:
    /// from rest, only segments that could be the fastest of all were tried, and maybe from elsewhere. What remains of a motion that is
    /// followed is not left for less than its worth. Returns the segment.
    fn straighten_fastest(&self, joined: &mut [Joined]) -> Option<Segment> {
        let fastest = joined
            .iter_mut()
            .min_by(|a, b| duration_s(a).total_cmp(&duration_s(b)))?;
        let path = fastest.1.as_ref().ok()?;
        if path.source == Source::Kept {
            return None;
        }
        let sampled = straight_path(&self.braking.motion.end(), &path.end());
        let delivered = self.after.to_trajectory(sampled.clone(), false, None);
        let from_rest = delivered.outcome.ok()?;
        let from_rest = Candidate::of(path.draw, Source::StraightLine, &from_rest);
        let segment = self.braking.candidate(&from_rest).ok()?;
        if segment.metrics.duration_s >= path.metrics.duration_s {
            return None;
        }
        fastest.1 = Ok(segment.clone());
        let draw = Draw {
            sampled: Some(sampled),
            path: Some(delivered.path),
            source: Source::StraightLine,
            outcome: Ok(segment.certified()),
        };
        Some(Segment {
            draw,
            joined: segment,
        })
    }
}

/// Duration of a joined motion, s; infinite where there is none.
fn duration_s(joined: &Joined) -> f64 {
    let motion = joined.1.as_ref();
    motion.map_or(f64::INFINITY, |motion| motion.metrics.duration_s)
}

/// The order in which candidates are joined: what remains of a motion that is followed, then the fastest from rest first.
fn in_order_of_selection(a: &Candidate, b: &Candidate) -> Ordering {
    let is_other = |candidate: &Candidate| candidate.source != Source::Kept;
    let by_duration = || a.metrics.duration_s.total_cmp(&b.metrics.duration_s);
    is_other(a).cmp(&is_other(b)).then_with(by_duration)
}

/// The joined candidate that is selected as the fastest.
fn select_of(joined: &[Joined]) -> Option<Candidate> {
    let motions = joined.iter().filter_map(|(_, it)| it.as_ref().ok());
    let mut candidates: Vec<Candidate> = motions.cloned().collect();
    let start = candidates.first()?.trajectory.knots()[0].position;
    let selected = select(&candidates, &start, Selection::ShortestTime)?;
    Some(candidates.swap_remove(selected))
}
