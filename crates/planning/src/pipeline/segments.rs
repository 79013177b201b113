//! Segments to goal configurations, straight or pushed out of obstacles, that are joined to a braking before other paths are planned: the fastest
//! motion of a request mostly is one.

use crate::motion::incumbent::{Incumbent, ShortestDuration};
use crate::path::waypoints::Waypoints;
use crate::pipeline::joining::{AT_ONCE, JoinedDraw, Joining};
use crate::plan::{Candidate, Draw, Failure};
use crate::request::ToBeDone;
use codes::Source;
use pcc_model::Configuration;
use rayon::prelude::*;
use trajectory::Trajectory;

/// Straight segments to goal configurations, pushed out of obstacles where they must be, joined to a braking before other paths are planned.
#[derive(Default)]
pub(super) struct JoinedSegments {
    pub(super) segments: Vec<JoinedDraw>,
    /// Whether no motion to any other goal configuration is expected to be faster than the fastest of these. To one whose segment became too
    /// slow when it was pushed, another path may be.
    pub(super) is_settled: bool,
}

impl JoinedSegments {
    /// The fastest motion of the request alone.
    fn of_fastest(fastest: JoinedDraw) -> Self {
        Self {
            segments: vec![fastest],
            is_settled: true,
        }
    }

    /// The fastest motion of the request, where it is known (decisions 0031 and 0040).
    pub(super) fn selected(&self) -> Option<&Candidate> {
        Some(&self.fastest()?.joined)
    }

    fn fastest(&self) -> Option<&JoinedDraw> {
        let duration_s = |it: &JoinedDraw| it.joined.metrics.duration_s;
        let segments = self.segments.iter().filter(|_| self.is_settled);
        segments.min_by(|a, b| duration_s(a).total_cmp(&duration_s(b)))
    }

    /// These without segments that were pushed and are not the fastest: other paths to the same goal configurations may be faster.
    fn without_slower_pushed(mut self) -> Self {
        let fastest = self.selected().map(|fastest| fastest.draw);
        self.segments
            .retain(|it| it.is_straight || Some(it.joined.draw) == fastest);
        self
    }
}

impl Joining<'_> {
    /// Joins segments to the goal configurations of the first draws, until the fastest motion is known or cannot be.
    pub(super) fn segments(&self, goals: &[Configuration]) -> JoinedSegments {
        let (start, from_rest) = (self.braking.motion.end(), self.braking.after());
        let least_s = |goal: &Configuration| from_rest.least_duration_s(&[start, *goal]);
        let mut order: Vec<(usize, f64)> = goals.iter().map(least_s).enumerate().collect();
        order.sort_by(|a, b| a.1.total_cmp(&b.1));
        let mut segments: Vec<JoinedDraw> = Vec::new();
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
        let segments = JoinedSegments {
            is_settled: others_s > longest_s,
            segments,
        };
        segments.without_slower_pushed()
    }

    /// The fastest of known segments, joined to this braking, which begins a moment later, and improved: it is still the fastest; where it is
    /// not certified from there, all segments anew.
    pub(super) fn fastest_again(
        &self,
        known: &JoinedSegments,
        goals: &[Configuration],
    ) -> JoinedSegments {
        let again = known.fastest().and_then(|it| self.again(it, goals));
        let again = again.map_or_else(|| self.segments(goals), JoinedSegments::of_fastest);
        self.with_fastest_improved(again)
    }

    /// A joined motion joined to this braking, its path moved to where the robot rests after that.
    fn again(&self, known: &JoinedDraw, goals: &[Configuration]) -> Option<JoinedDraw> {
        let index = known.joined.draw;
        if known.is_straight {
            return self.straight(index, &goals[index]).ok();
        }
        let from_rest = Draw {
            outcome: Ok(known.from_rest.certified()),
            ..known.draw.clone()
        };
        let straight_s = self.straight_s(&goals[index]);
        let straight_s = straight_s.unwrap_or(known.straight_s);
        self.joined(index, from_rest, straight_s).ok()
    }

    /// Whether the fastest motion is to be planned anew, since it may be later than one after a stop.
    pub(super) fn expects_planning_anew(&self, segments: &JoinedSegments) -> bool {
        let fastest = segments.fastest();
        fastest.is_some_and(|it| self.is_to_be_planned_anew(&it.joined, it.straight_s))
    }

    /// What is to be done where the fastest of known segments is to be joined again.
    pub(super) fn work_again(&self, known: &JoinedSegments) -> ToBeDone {
        match known.fastest() {
            Some(it) if it.is_straight => ToBeDone::SegmentAgain,
            Some(it) if self.may_be_planned_anew_again(&it.joined, it.straight_s) => {
                ToBeDone::PathAgainAndPlanningAnew
            }
            _ => ToBeDone::PathAgain,
        }
    }

    /// The segments, the fastest motion of the request among them improved.
    pub(super) fn with_fastest_improved(&self, known: JoinedSegments) -> JoinedSegments {
        let fastest = known.selected().map(|fastest| fastest.draw);
        let improved = |it: JoinedDraw| match fastest == Some(it.joined.draw) {
            true => self.improved(it),
            false => it,
        };
        JoinedSegments {
            segments: known.segments.into_iter().map(improved).collect(),
            ..known
        }
    }

    /// The segment to a configuration as a motion joined to the braking, pushed out of obstacles where motions may be planned anew;
    /// [`Failure::Slower`] where it takes longer than `longest_s` from rest.
    fn segment(
        &self,
        draw: usize,
        goal: &Configuration,
        longest_s: f64,
    ) -> Result<JoinedDraw, Failure> {
        if self.is_interrupted() {
            return Err(Failure::Truncated);
        }
        let (path, motion) = self.timed_segment(goal)?;
        let straight_s = motion.duration();
        if straight_s > longest_s {
            return Err(Failure::Slower);
        }
        match self.certified_segment(draw, path.clone(), motion) {
            Err(Failure::Collision | Failure::Bending) if self.pushes() => {
                let it = self.pushed(path, longest_s);
                self.joined(draw, it, straight_s)
            }
            straight => straight,
        }
    }

    /// The straight segment itself.
    fn straight(&self, draw: usize, goal: &Configuration) -> Result<JoinedDraw, Failure> {
        let (path, motion) = self.timed_segment(goal)?;
        self.certified_segment(draw, path, motion)
    }

    /// A straight segment's motion certified and joined.
    fn certified_segment(
        &self,
        draw: usize,
        path: Waypoints,
        motion: Trajectory,
    ) -> Result<JoinedDraw, Failure> {
        let straight_s = motion.duration();
        let draw_of_path = Draw {
            sampled: Some(path.clone()),
            path: Some(path),
            source: Source::StraightLine,
            outcome: self.braking.after().certified(motion),
        };
        Ok(JoinedDraw {
            is_straight: true,
            ..self.joined(draw, draw_of_path, straight_s)?
        })
    }

    fn pushes(&self) -> bool {
        self.anew.is_some() && self.braking.after().corrections > 0
    }

    /// The straight segment pushed out of obstacles.
    fn pushed(&self, path: Waypoints, longest_s: f64) -> Draw {
        let shortest = ShortestDuration::none();
        shortest.note(longest_s);
        let incumbent = Incumbent::new(&shortest);
        let from_rest = self.braking.after();
        let delivered = from_rest.to_trajectory(path.clone(), false, Some(&incumbent));
        Draw {
            sampled: Some(path),
            path: Some(delivered.path),
            source: Source::StraightLine,
            outcome: delivered.outcome,
        }
    }
}
