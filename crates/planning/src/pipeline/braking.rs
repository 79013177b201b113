//! Starts in motion: the robot brakes straight ahead, and every motion begins while it does, or after that.

use crate::error::Infeasible;
use crate::motion::along_polyline::append;
use crate::motion::constraints::MotionConstraints;
use crate::motion::through::Through;
use crate::path::waypoints::{WAYPOINTS, Waypoints, begun_in, resample};
use crate::pipeline::selection::select;
use crate::plan::{Candidate, Certified, Draw, Failure, Plan};
use crate::problem::Problem;
use crate::request::Request;
use codes::{Selection, Source, Stage};
use pcc_model::{Configuration, TendonLimits};
use rayon::prelude::*;
use std::mem;
use trajectory::{Knot, Trajectory, limit_use, stopping_motion};

/// Knots that a motion may have at least, however many its braking needs.
const LEAST_KNOTS: usize = 4;
/// Samples of a motion, equally spaced in time, by which its path is known.
const SAMPLES: usize = 4 * WAYPOINTS;
/// Candidates that are joined at once, as long as one of them may be selected.
const AT_ONCE: usize = 2;
/// Share of the braking by which a joined motion is expected to be faster than the motion from rest at most: in 300 replans no candidate that
/// was left out by this, or by none of it, became the fastest.
const LARGEST_GAIN: f64 = 0.25;
/// Relative amount by which a limit may be exceeded: the rounding of the measure.
const ROUNDING: f64 = 1e-6;

/// A certified motion to rest, from whose end a request is planned.
pub(super) struct Braking<'a> {
    constraints: &'a MotionConstraints<'a>,
    pub(super) motion: Trajectory,
    /// Smallest clearance of the body from obstacles at rest while it brakes, section lengths.
    clearance: f64,
}

impl<'a> Braking<'a> {
    /// Brakes from a state, within the robot's whole limits.
    pub(crate) fn new(
        constraints: &'a MotionConstraints<'a>,
        state: &Knot,
    ) -> Result<Self, Infeasible> {
        let robot = constraints.robot;
        let limits: &TendonLimits = &robot.tendon_limits;
        let state = Knot {
            time: 0.0,
            ..*state
        };
        let motion = stopping_motion(&state, &robot.tendons, limits).map_err(|_| {
            Infeasible::StartTooFast {
                share: f64::INFINITY,
            }
        })?;
        let share = limit_use(&motion, &robot.tendons, limits).largest();
        if share > 1.0 + ROUNDING {
            return Err(Infeasible::StartTooFast { share });
        }
        match constraints.among_resting().certify(&motion) {
            Ok(clearance) => Ok(Self {
                constraints,
                motion,
                clearance,
            }),
            Err(_) => Err(Infeasible::StartCannotStop),
        }
    }

    /// The problem and the request from where the robot then rests, with the knots that braking leaves of a motion.
    pub(super) fn what_follows(&self, problem: &Problem, request: &Request) -> (Problem, Request) {
        let braking_knots = self.motion.knots().len() - 1;
        let problem = Problem {
            start: self.motion.end(),
            moving: problem.moving.after(self.motion.duration()),
            ..problem.clone()
        };
        let request = Request {
            knots: request.knots.saturating_sub(braking_knots).max(LEAST_KNOTS),
            ..request.clone()
        };
        (problem, request)
    }

    /// The state in which the robot begins to brake.
    pub(super) fn state(&self) -> &Knot {
        &self.motion.knots()[0]
    }

    /// Braking to rest, and then a route.
    pub(super) fn before_route(&self, route: &Through) -> Result<Through, Failure> {
        let motion = self.then(&route.motion.trajectory, route.motion.metrics.clearance)?;
        let braking_s = self.motion.duration();
        let passages = route
            .passages
            .iter()
            .map(|passage| passage.later(braking_s));
        Ok(Through {
            motion,
            passages: passages.collect(),
        })
    }

    /// Braking, and then this motion.
    fn before(&self, motion: &Trajectory) -> Trajectory {
        let mut knots = self.motion.knots().to_vec();
        append(&mut knots, motion);
        Trajectory::new(knots).expect("two motions one after the other are one")
    }

    /// The candidate with its motion joined to the one that the robot brakes from: while it brakes where that is certified and faster,
    /// else after it. None where a moving ball comes too near to both.
    pub(crate) fn candidate(&self, candidate: &Candidate) -> Option<Candidate> {
        let joined = self.beside(&candidate.trajectory);
        let after = || self.then(&candidate.trajectory, candidate.metrics.clearance);
        let motion = joined.or_else(|| after().ok())?;
        Some(Candidate::of(candidate.draw, candidate.source, &motion))
    }

    /// The path of a motion, begun where the robot rests after braking.
    fn path(&self, motion: &Trajectory) -> Waypoints {
        begun_in(&self.motion.end(), resample(&motion.sample(SAMPLES)))
    }

    /// The motion to the end of this one that begins while the robot brakes, if it is certified and faster than one after the other.
    fn beside(&self, motion: &Trajectory) -> Option<Certified> {
        let path = self.path(motion);
        let stop_then_go_s = self.motion.duration() + motion.duration();
        self.constraints
            .certified_from(self.state(), &path, stop_then_go_s)
    }

    /// Braking to rest, and then a certified motion with this clearance, section lengths, or one along its path where that begins elsewhere.
    /// Among moving balls that is certified as a whole: how far they may be from where they are expected depends on the longest stop of all
    /// of it.
    fn then(&self, motion: &Trajectory, clearance: f64) -> Result<Certified, Failure> {
        if motion.knots()[0].position != self.motion.end() {
            let knots = motion.knots().len();
            let moved = self.constraints.parameterize(&self.path(motion), knots)?;
            return self.constraints.certified(self.before(&moved));
        }
        let whole = self.before(motion);
        if !self.constraints.moving.is_empty() {
            return self.constraints.certified(whole);
        }
        let clearance = self.clearance.min(clearance);
        Ok(self.constraints.describe(whole, clearance))
    }

    /// The plan with every motion joined to the braking, and the figures of the whole motions. `straight` makes a motion from rest of
    /// the straight segment to a configuration; `selected` is told of the fastest motion before the others are joined.
    pub(crate) fn plan(
        &self,
        mut plan: Plan,
        straight: impl Fn(Configuration) -> Draw + Sync,
        selected: Option<&(dyn Fn(Candidate) + Sync)>,
    ) -> Plan {
        let mut stages = plan.stages;
        stages.measure(Stage::Select, || self.join(&mut plan, straight, selected));
        plan.stages = stages;
        plan
    }

    fn join(
        &self,
        plan: &mut Plan,
        straight: impl Fn(Configuration) -> Draw + Sync,
        selected: Option<&(dyn Fn(Candidate) + Sync)>,
    ) {
        let from_rest = mem::take(&mut plan.candidates);
        let order = selection_order(&from_rest);
        let mut joined = self.join_fastest(&from_rest, &order);
        let others = &order[joined.len()..];
        let (segment, others) = rayon::join(
            || {
                let segment = self.straighten_fastest(&mut joined, &straight);
                if let (Some(tell), Some(candidate)) = (selected, select_of(&joined)) {
                    tell(candidate);
                }
                segment
            },
            || self.join_others(&from_rest, others),
        );
        joined.extend(others);
        joined.sort_by_key(|(index, _)| *index);
        for (index, joined) in &joined {
            let outcome = joined.as_ref().map(Candidate::certified);
            plan.draws[from_rest[*index].draw].outcome = outcome.map_err(|failure| *failure);
            plan.truncated |= joined.as_ref().err() == Some(&Failure::Truncated);
        }
        if let Some((draw, segment)) = segment {
            plan.draws[draw] = segment;
        }
        plan.candidates = joined.into_iter().filter_map(|it| it.1.ok()).collect();
    }

    /// Joins candidates in this order until no other one is expected to become faster than the fastest joined one.
    fn join_fastest(&self, from_rest: &[Candidate], order: &[usize]) -> Vec<Joined> {
        let mut joined: Vec<Joined> = Vec::with_capacity(from_rest.len());
        let mut fastest_s = f64::INFINITY;
        for round in order.chunks(AT_ONCE) {
            let soonest_s = from_rest[round[0]].metrics.duration_s;
            if soonest_s - LARGEST_GAIN * self.motion.duration() > fastest_s {
                break;
            }
            let whole = |&index| (index, self.outcome(&from_rest[index]));
            joined.par_extend(round.par_iter().map(whole));
            fastest_s = joined.iter().map(duration_s).fold(f64::INFINITY, f64::min);
        }
        joined.sort_by_key(|(index, _)| *index);
        joined
    }

    /// Joins candidates that are not selected, until the request is interrupted. One worker is left idle: the selected motion is published
    /// meanwhile, and its way to the loop needs a processor.
    fn join_others(&self, from_rest: &[Candidate], others: &[usize]) -> Vec<Joined> {
        let whole = |&index| {
            let outcome = if (self.constraints.interrupt)() {
                Err(Failure::Truncated)
            } else {
                self.outcome(&from_rest[index])
            };
            (index, outcome)
        };
        let workers = rayon::current_num_threads().saturating_sub(1).max(1);
        let of_a_worker = others.len().div_ceil(workers).max(1);
        let others = others.par_iter().with_min_len(of_a_worker);
        others.map(whole).collect()
    }

    fn outcome(&self, from_rest: &Candidate) -> Result<Candidate, Failure> {
        self.candidate(from_rest).ok_or(Failure::Collision)
    }

    /// Puts the straight segment in the place of the path of the fastest motion, where its motion is faster: from rest, only segments
    /// that could be the fastest of all were tried. What remains of a motion that is followed is not left for less than its worth.
    /// Returns the draw of the segment, and which one it is.
    fn straighten_fastest(
        &self,
        joined: &mut [Joined],
        straight: impl Fn(Configuration) -> Draw,
    ) -> Option<(usize, Draw)> {
        let fastest = joined
            .iter_mut()
            .min_by(|a, b| duration_s(a).total_cmp(&duration_s(b)))?;
        let path = fastest.1.as_ref().ok()?;
        if matches!(path.source, Source::StraightLine | Source::Kept) {
            return None;
        }
        let mut draw = straight(path.end());
        let from_rest = Candidate::of(path.draw, draw.source, draw.outcome.as_ref().ok()?);
        let segment = self.candidate(&from_rest)?;
        if segment.metrics.duration_s >= path.metrics.duration_s {
            return None;
        }
        draw.outcome = Ok(segment.certified());
        let index = segment.draw;
        fastest.1 = Ok(segment);
        Some((index, draw))
    }
}

/// A candidate's index, and its motion joined to the braking.
type Joined = (usize, Result<Candidate, Failure>);

/// Duration of a joined motion, s; infinite where there is none.
fn duration_s(joined: &Joined) -> f64 {
    let motion = joined.1.as_ref();
    motion.map_or(f64::INFINITY, |motion| motion.metrics.duration_s)
}

/// The order in which candidates are joined: what remains of a motion that is followed, then the fastest from rest first.
fn selection_order(from_rest: &[Candidate]) -> Vec<usize> {
    let key = |index: &usize| {
        let candidate = &from_rest[*index];
        let is_kept = candidate.source == Source::Kept;
        (!is_kept, candidate.metrics.duration_s)
    };
    let mut order: Vec<usize> = (0..from_rest.len()).collect();
    order.sort_by(|a, b| {
        let (a, b) = (key(a), key(b));
        a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
    });
    order
}

/// The joined candidate that is selected as the fastest.
fn select_of(joined: &[Joined]) -> Option<Candidate> {
    let motions = joined.iter().filter_map(|(_, it)| it.as_ref().ok());
    let mut candidates: Vec<Candidate> = motions.cloned().collect();
    let start = candidates.first()?.trajectory.knots()[0].position;
    let selected = select(&candidates, &start, Selection::ShortestTime)?;
    Some(candidates.swap_remove(selected))
}
