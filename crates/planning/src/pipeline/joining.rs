//! A motion from rest is joined to the braking of a robot in motion, with the best of some ways to brake, or planned anew.

use crate::path::waypoints::{Waypoints, straight_path};
use crate::pipeline::braking::Braking;
use crate::plan::{Candidate, Draw, Failure};
use pcc_model::Configuration;
use trajectory::Trajectory;

/// Candidates that are joined at once, as long as one of them may be selected.
pub(super) const AT_ONCE: usize = 2;
/// Share of the braking by which a joined motion is expected to be faster than the motion from rest at most: in 300 replans no candidate that
/// was left out by this, or by none of it, became the fastest.
const LARGEST_GAIN: f64 = 0.25;
/// Share of the braking by which a joined motion is mostly faster than after a stop, at least.
pub(super) const USUAL_GAIN: f64 = 0.5;
/// Share of the braking that a joined motion wins at least, in 97 of 100 replans.
const LITTLE_GAIN: f64 = 0.15;
/// Share of its duration by which a motion may be faster than that along the straight segment to the same configuration: paths are timed at
/// points, and their jerk is bounded by an average. In 16,000 replans half of it at most.
const TIMING_ERROR: f64 = 0.002;

/// Joins motions to a braking.
#[derive(Clone, Copy)]
pub(super) struct Joining<'a> {
    pub(super) braking: &'a Braking<'a>,
    /// Plans from where the robot rests after a braking to one configuration alone; its fastest draw. None where the fastest motion is taken
    /// as it is.
    pub(super) anew: Option<&'a PlanAnew<'a>>,
}

/// The fastest draw of a plan from where a robot rests after a braking to a configuration.
type PlanAnew<'a> = dyn Fn(&Braking, &Configuration) -> Option<Draw> + Sync + 'a;

/// A draw whose motion is joined to a braking, that motion from rest, and joined.
pub(super) struct JoinedDraw {
    pub(super) draw: Draw,
    pub(super) from_rest: Candidate,
    pub(super) joined: Candidate,
    /// Whether its path is the straight segment itself.
    pub(super) is_straight: bool,
    /// The time of the straight segment to the same goal configuration from rest, clear or not, s.
    pub(super) straight_s: f64,
}

impl<'a> Joining<'a> {
    /// Joins motions to another braking.
    pub(super) fn to_braking(self, braking: &'a Braking<'a>) -> Self {
        Self { braking, ..self }
    }

    /// A joined motion with the best of more ways to brake, or planned anew where it may be later than after a stop.
    pub(super) fn improved(&self, it: JoinedDraw) -> JoinedDraw {
        let anew = self.planned_anew(&it.joined, it.straight_s);
        anew.unwrap_or_else(|| self.braked_otherwise(it))
    }

    /// The draw with its motion joined with the best of more ways to brake, where the usual ones win little of the braking.
    fn braked_otherwise(&self, mut it: JoinedDraw) -> JoinedDraw {
        let braking_s = self.braking.motion.duration();
        let joined_s = it.joined.metrics.duration_s;
        let gain_s = braking_s + it.from_rest.metrics.duration_s - joined_s;
        if gain_s > LITTLE_GAIN * braking_s {
            return it;
        }
        let otherwise = self
            .braking
            .candidate_braked_otherwise(&it.from_rest, joined_s);
        if let Some(faster) = otherwise {
            it.draw.outcome = Ok(faster.certified());
            it.joined = faster;
        }
        it
    }

    pub(super) fn is_interrupted(&self) -> bool {
        (self.braking.after().interrupt)()
    }

    /// The duration by which a joined motion is expected to be shorter than the motion from rest at most, s.
    pub(super) fn largest_gain_s(&self) -> f64 {
        LARGEST_GAIN * self.braking.motion.duration()
    }

    /// The fastest motion of a plan to the goal configuration of a known one alone, from where the robot now rests after braking, where the known
    /// one is to be planned anew and this one is faster: the faster of both is no later than after a stop.
    pub(super) fn planned_anew(&self, known: &Candidate, straight_s: f64) -> Option<JoinedDraw> {
        if !self.is_to_be_planned_anew(known, straight_s) {
            return None;
        }
        let fastest = (self.anew?)(self.braking, &known.end())?;
        let it = self.joined(known.draw, fastest, straight_s).ok()?;
        let it = self.braked_otherwise(it);
        (it.joined.metrics.duration_s < known.metrics.duration_s).then_some(it)
    }

    /// Whether a joined motion is to be planned anew: where that is wanted, and the motion may arrive later than the fastest one after a stop. From
    /// rest none is faster than the straight segment, which takes `straight_s`, by more than [`TIMING_ERROR`].
    pub(super) fn is_to_be_planned_anew(&self, joined: &Candidate, straight_s: f64) -> bool {
        self.plans_anew() && !self.wins(0.0, joined, straight_s)
    }

    /// Whether that is to be expected of a joined motion once it is joined to a braking a moment later: where it wins little of this one.
    pub(super) fn may_be_planned_anew_again(&self, joined: &Candidate, straight_s: f64) -> bool {
        self.plans_anew() && !self.wins(LITTLE_GAIN, joined, straight_s)
    }

    /// Whether a joined motion is faster by a share of the braking than any after a stop.
    fn wins(&self, share: f64, joined: &Candidate, straight_s: f64) -> bool {
        let braking_s = self.braking.motion.duration();
        let least_s = (1.0 - share) * braking_s + (1.0 - TIMING_ERROR) * straight_s;
        joined.metrics.duration_s <= least_s
    }

    pub(super) fn plans_anew(&self) -> bool {
        self.anew.is_some() && !self.is_interrupted()
    }

    /// The time of the straight segment from where the robot rests after braking, s.
    pub(super) fn straight_s(&self, end: &Configuration) -> Option<f64> {
        let (_, motion) = self.timed_segment(end).ok()?;
        Some(motion.duration())
    }

    /// The path of the straight segment from where the robot rests after braking, and its motion, which is not certified.
    pub(super) fn timed_segment(
        &self,
        goal: &Configuration,
    ) -> Result<(Waypoints, Trajectory), Failure> {
        let path = straight_path(&self.braking.motion.end(), goal);
        let motion = self.braking.after().time(&path)?;
        Ok((path, motion))
    }

    /// A draw from rest with its motion joined to the braking.
    pub(super) fn joined(
        &self,
        index: usize,
        draw: Draw,
        straight_s: f64,
    ) -> Result<JoinedDraw, Failure> {
        let motion = draw.outcome.as_ref().map_err(|failure| *failure)?;
        let from_rest = Candidate::of(index, draw.source, motion);
        let joined = self.braking.candidate(&from_rest)?;
        Ok(JoinedDraw {
            draw: Draw {
                outcome: Ok(joined.certified()),
                ..draw
            },
            from_rest,
            joined,
            is_straight: false,
            straight_s,
        })
    }
}
