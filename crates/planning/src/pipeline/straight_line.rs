//! Straight segments: as the null arm's paths, and beside learned paths, where the segment that is the fastest motion of all takes the
//! place of the path to its goal configuration.
//!
//! Beside learned paths, workers try segments once all paths are drawn and taken, in the order of the least time that each can take, and
//! stop one as soon as it is surely slower than the fastest motion so far. A segment counts with its duration or, if that is longer,
//! with the longest bound on it that was met on its way; a motion of its own that was not certified is one. The one that counts least is
//! never stopped, since no motion ever counts less, so which one wins does not depend on the order in which workers finish.

use crate::motion::incumbent::{Incumbent, ShortestDuration};
use crate::path::waypoints::straight_path;
use crate::pipeline::context::{Deliveries, Drawn, Proposal, RequestContext};
use crate::pipeline::goal_set::GoalSet;
use crate::plan::Draw;
use crate::stage_times::StageTimes;
use codes::{Sampler, Source};
use pcc_model::Configuration;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// A straight segment to each goal configuration, with its tip smoothed for [`Sampler::StraightDrawn`].
pub(crate) fn draw(context: &RequestContext, goals: &GoalSet, times: &mut StageTimes) -> Drawn {
    let start = &context.problem.start;
    let smooths_tip = context.request.sampler == Sampler::StraightDrawn;
    let segment = |(draw, goal)| Proposal {
        draw: Some(draw),
        smooths_tip,
        ..Proposal::of(straight_path(start, goal), Source::StraightLine)
    };
    let segments = goals.distinct.iter().enumerate().map(segment);
    context.deliver_timed(segments.collect(), times).into()
}

/// A segment that was tried.
struct StraightLineCandidate {
    /// The segment's place in the order of least durations.
    place: usize,
    /// The shortest duration of an incumbent that does not stop it, s; infinite where it makes no motion.
    counted_s: f64,
    delivered: (Draw, StageTimes),
}

/// The segments from the start to the goal configurations of a request.
pub(super) struct StraightLineCandidates<'a> {
    context: &'a RequestContext<'a>,
    goals: &'a [Configuration],
    /// Goals by index, with the least duration of the segment to each, s.
    order: Vec<(usize, f64)>,
    /// Paths that are to be drawn, or drawn, and not yet taken by a worker.
    waiting: AtomicUsize,
    begun: AtomicUsize,
    shortest: ShortestDuration,
    tried: Mutex<Vec<StraightLineCandidate>>,
}

impl<'a> StraightLineCandidates<'a> {
    /// Segments to `goals`.
    pub(crate) fn new(context: &'a RequestContext<'a>, goals: &'a [Configuration]) -> Self {
        let start = context.problem.start;
        let least_s = |goal: &Configuration| context.constraints.least_duration_s(&[start, *goal]);
        let mut order: Vec<(usize, f64)> = goals.iter().map(least_s).enumerate().collect();
        order.sort_by(|a, b| a.1.total_cmp(&b.1));
        Self {
            context,
            goals,
            order,
            waiting: AtomicUsize::new(0),
            begun: AtomicUsize::new(0),
            shortest: ShortestDuration::none(),
            tried: Mutex::default(),
        }
    }

    /// Announces so many paths that are to be drawn: no segment is tried before all of them are taken.
    pub(super) fn wait_for(&self, paths: usize) {
        self.waiting.fetch_add(paths, Ordering::Relaxed);
    }

    /// Makes a motion of a drawn path that was announced, and tries segments after that if no other path waits.
    pub(super) fn deliver(&self, proposal: Proposal) -> (Draw, StageTimes) {
        self.waiting.fetch_sub(1, Ordering::Relaxed);
        let delivered = self.context.deliver(proposal);
        self.shortest.note(delivered.0.duration_s());
        while self.waiting.load(Ordering::Relaxed) == 0 && self.try_next() {}
        delivered
    }

    /// Tries the next segment that may be the fastest; whether there was one.
    fn try_next(&self) -> bool {
        let place = self.begun.fetch_add(1, Ordering::Relaxed);
        let Some(&(goal, least_s)) = self.order.get(place) else {
            return false;
        };
        if least_s > self.shortest.duration_s() {
            return false;
        }
        let path = straight_path(&self.context.problem.start, &self.goals[goal]);
        let incumbent = Incumbent::new(&self.shortest);
        let proposal = Proposal::of(path, Source::StraightLine);
        let delivered = self.context.deliver_against(proposal, Some(&incumbent));
        let counted_s = delivered.0.duration_s().max(incumbent.longest_bound_s());
        self.shortest.note(counted_s);
        let candidate = StraightLineCandidate {
            place,
            counted_s,
            delivered,
        };
        let mut tried = self.tried.lock().unwrap_or_else(PoisonError::into_inner);
        tried.push(candidate);
        true
    }

    /// The segments that were tried, and which one is faster than all of these motions and all other segments: its goal and its index
    /// among the tried ones; none where a drawn path is as fast.
    pub(super) fn decide(
        self,
        drawn: &[(Draw, StageTimes)],
    ) -> (Deliveries, Option<(usize, usize)>) {
        let tried = self.tried.into_inner();
        let mut tried = tried.unwrap_or_else(PoisonError::into_inner);
        tried.sort_by_key(|candidate| candidate.place);
        let drawn_s = drawn.iter().map(|(draw, _)| draw.duration_s());
        let counted_s = tried.iter().map(|candidate| candidate.counted_s);
        let winner = fastest(drawn_s.fold(f64::INFINITY, f64::min), counted_s);
        let winner = winner.map(|index| (self.order[tried[index].place].0, index));
        let segments = tried.into_iter().map(|candidate| candidate.delivered);
        (segments.collect(), winner)
    }
}

/// The index of the least of these durations (s), the first of equal ones; none where a drawn path is as fast, or all are infinite.
fn fastest(drawn_s: f64, counted_s: impl Iterator<Item = f64>) -> Option<usize> {
    let (mut least_s, mut fastest) = (drawn_s, None);
    for (index, counted_s) in counted_s.enumerate() {
        if counted_s < least_s {
            (least_s, fastest) = (counted_s, Some(index));
        }
    }
    fastest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_of_the_fastest_wins_where_no_drawn_path_is_as_fast() {
        let of = |drawn_s: f64, counted_s: &[f64]| fastest(drawn_s, counted_s.iter().copied());
        assert_eq!(of(9.0, &[9.5, 8.0, f64::INFINITY, 8.0]), Some(1));
        assert_eq!(of(8.0, &[9.5, 8.0]), None);
        assert_eq!(of(f64::INFINITY, &[f64::INFINITY, 7.0]), Some(1));
        assert_eq!(of(f64::INFINITY, &[f64::INFINITY]), None);
    }
}
