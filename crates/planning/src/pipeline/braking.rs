//! Starts in motion: the robot brakes to rest, and every motion begins while it does, or after that.

use crate::error::Infeasible;
use crate::motion::along_polyline::append;
use crate::motion::constraints::{BRAKING_SHARES, MotionConstraints};
use crate::motion::through::Through;
use crate::path::waypoints::{WAYPOINTS, Waypoints, begun_in, resample};
use crate::plan::{Candidate, Certified, Failure};
use crate::problem::Problem;
use crate::request::Request;
use pcc_model::TendonLimits;
use rayon::prelude::*;
use trajectory::{Knot, STOPPING_KNOTS, Trajectory, limit_use, stopping_motion};

/// Knots that a motion may have at least, however many its braking needs.
const LEAST_KNOTS: usize = 4;
/// Samples of a motion, equally spaced in time, by which its path is known.
const SAMPLES: usize = 4 * WAYPOINTS;
/// Shares of the acceleration limit for braking beside a path, where the usual ones win little.
const OTHER_SHARES: [f64; 4] = [0.98, 0.7, 0.3, 0.15];
/// Relative amount by which a limit may be exceeded: the rounding of the measure.
const ROUNDING: f64 = 1e-6;

/// A certified motion to rest, from whose end a request is planned.
pub(super) struct Braking<'a> {
    /// What the motions from the state on must keep.
    constraints: MotionConstraints<'a>,
    pub(super) motion: Trajectory,
    /// Smallest clearance of the body from obstacles at rest while it brakes, section lengths.
    clearance: f64,
}

impl<'a> Braking<'a> {
    /// Brakes from a state, within the robot's whole limits, and bends no further than the state does.
    pub(crate) fn new(
        constraints: &MotionConstraints<'a>,
        state: &Knot,
    ) -> Result<Self, Infeasible> {
        let constraints = constraints.bending_no_more_than(&state.position);
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
        let problem = Problem {
            start: self.motion.end(),
            moving: problem.moving.after(self.motion.duration()),
            ..problem.clone()
        };
        let request = Request {
            knots: knots_after_braking(request.knots),
            ..request.clone()
        };
        (problem, request)
    }

    /// What motions from where the robot then rests must keep.
    pub(super) fn after(&self) -> MotionConstraints<'a> {
        MotionConstraints {
            knots: knots_after_braking(self.constraints.knots),
            ..self.constraints
        }
    }

    /// Bending above the limit that the motions from the state on may have, rad.
    pub(super) fn bending_slack_rad(&self) -> f64 {
        self.constraints.bending_slack_rad
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
    /// else after it. Fails where a moving ball comes too near to both, or where a path that begins elsewhere cannot be begun here.
    pub(crate) fn candidate(&self, candidate: &Candidate) -> Result<Candidate, Failure> {
        let Candidate {
            trajectory,
            metrics,
            ..
        } = candidate;
        let begins_here = trajectory.knots()[0].position == self.motion.end();
        let motion = match self.beside(trajectory) {
            Some(motion) => motion,
            None if begins_here => self.then(trajectory, metrics.clearance)?,
            None => self.begun_here(trajectory)?,
        };
        Ok(Candidate::of(candidate.draw, candidate.source, &motion))
    }

    /// The motion along the path of one that begins near to where the robot rests after braking, corrected from there.
    fn begun_here(&self, motion: &Trajectory) -> Result<Certified, Failure> {
        let delivered = self.after().to_trajectory(self.path(motion), false, None);
        let Certified {
            trajectory,
            metrics,
        } = delivered.outcome?;
        let joined = self.beside(&trajectory);
        joined.map_or_else(|| self.then(&trajectory, metrics.clearance), Ok)
    }

    /// The path of a motion, begun where the robot rests after braking.
    fn path(&self, motion: &Trajectory) -> Waypoints {
        begun_in(&self.motion.end(), resample(&motion.sample(SAMPLES)))
    }

    /// The candidate with the fastest of more motions joined to the braking, if one takes less than `longest_s`.
    pub(super) fn candidate_braked_otherwise(
        &self,
        candidate: &Candidate,
        longest_s: f64,
    ) -> Option<Candidate> {
        let path = self.path(&candidate.trajectory);
        let with_share = |share: &f64| {
            self.constraints
                .certified_from(self.state(), &[*share], &path, longest_s)
        };
        let motions: Vec<_> = OTHER_SHARES.par_iter().filter_map(with_share).collect();
        let motions = motions.iter();
        let fastest =
            motions.min_by(|a, b| a.metrics.duration_s.total_cmp(&b.metrics.duration_s))?;
        Some(Candidate::of(candidate.draw, candidate.source, fastest))
    }

    /// The motion to the end of this one that begins while the robot brakes, or, where that is not certified, as soon as it has braked, if it is
    /// faster than one after the other.
    fn beside(&self, motion: &Trajectory) -> Option<Certified> {
        let path = self.path(motion);
        let stop_then_go_s = self.motion.duration() + motion.duration();
        let with_shares = |shares: &[f64]| {
            self.constraints
                .certified_from(self.state(), shares, &path, stop_then_go_s)
        };
        with_shares(&BRAKING_SHARES).or_else(|| with_shares(&[]))
    }

    /// Braking to rest, and then a certified motion with this clearance, section lengths. Among moving balls that is certified as a
    /// whole: how far they may be from where they are expected depends on the longest stop of all of it.
    fn then(&self, motion: &Trajectory, clearance: f64) -> Result<Certified, Failure> {
        let whole = self.before(motion);
        if !self.constraints.moving.is_empty() {
            return self.constraints.certified(whole);
        }
        let clearance = self.clearance.min(clearance);
        Ok(self.constraints.describe(whole, clearance))
    }
}

/// The knots that are left to what follows braking, of those of a whole motion: as many however many the braking takes, so that what
/// follows is timed like a motion from rest.
fn knots_after_braking(knots: usize) -> usize {
    knots.saturating_sub(STOPPING_KNOTS).max(LEAST_KNOTS)
}
