//! What a motion must keep, and making one that does of a path: timing, the certificate of the executed curve, its figures.

use crate::motion::duration_bound;
use crate::moving_obstacles::{self, MovingObstacles};
use crate::optimize::smooth_update::PushKernel;
use crate::optimize::tip_path::TipPaths;
use crate::path::metrics::{CLEARANCE_TOLERANCE, PathMetrics};
use crate::plan::{Certified, Failure};
use crate::request::Interrupt;
use collision::{MovingBall, Scene, certified_clearance, certify_moving};
use pcc_model::{Configuration, TendonLimits, UnitRobot};
use std::cell::RefCell;
use trajectory::{
    Knot, MovingStart, ParameterizationOptions, QuinticSegment, TimeParameterizer, Trajectory,
};

/// Shares of the acceleration limit for the braking of a motion that begins in motion: of one to six shares from 0.3 to 1, these two
/// win 0.83 of the shortest stop in the median, six 0.88 in nearly twice the time.
pub(crate) const BRAKING_SHARES: [f64; 2] = [0.9, 0.5];

/// Halvings of a segment by which its bending is bounded at most.
const HALVINGS: usize = 4;
/// Shortest of the longest stops of motions that are not very short, s: the first look at moving balls is by it.
const SHORTEST_STOP_S: f64 = 0.2;

thread_local! {
    /// Working memory of each worker, kept from request to request.
    static PARAMETERIZER: RefCell<TimeParameterizer> = RefCell::default();
}

/// Bending above a limit that is rounding, rad.
const BENDING_ROUNDING_RAD: f64 = 1e-9;

/// What a motion must keep, and how far its path may be corrected to that end.
#[derive(Clone, Copy)]
pub(crate) struct MotionConstraints<'a> {
    /// The robot in section lengths, as it is.
    pub(crate) robot: &'a UnitRobot,
    /// The robot with the padded tubes that must keep clear.
    pub(crate) padded: &'a UnitRobot,
    pub(crate) scene: &'a Scene,
    /// Obstacles that move.
    pub(crate) moving: &'a MovingObstacles,
    pub(crate) kernel: &'a PushKernel,
    pub(crate) tip_paths: &'a TipPaths,
    /// Tendon limits of the motion, scaled as the request wants.
    pub(crate) limits: TendonLimits,
    /// Knots that a motion may have.
    pub(crate) knots: usize,
    /// Bending above the limit that a motion may have, rad.
    pub(crate) bending_slack_rad: f64,
    /// Corrections that a path gets at most.
    pub(crate) corrections: usize,
    /// Asked between the steps; true truncates.
    pub(crate) interrupt: Interrupt<'a>,
}

impl<'a> MotionConstraints<'a> {
    /// The same for motions that bend no further beyond the limit than a configuration does, but for rounding.
    pub(crate) fn bending_no_more_than(&self, configuration: &Configuration) -> Self {
        let excess_rad = self.robot.limit_excess(configuration).max(0.0);
        Self {
            bending_slack_rad: excess_rad + BENDING_ROUNDING_RAD,
            ..*self
        }
    }

    /// The same without obstacles that move.
    pub(crate) fn among_resting(&self) -> Self {
        Self {
            moving: &moving_obstacles::NONE,
            ..*self
        }
    }

    /// Lower bound of the duration of a motion along a path, s.
    pub(crate) fn least_duration_s(&self, path: &[Configuration]) -> f64 {
        duration_bound::least_duration_s(self.robot, &self.limits, path)
    }

    /// Times a path of 64 waypoints from rest to rest.
    pub(crate) fn time(&self, path: &[Configuration]) -> Result<Trajectory, Failure> {
        self.parameterize(path, self.knots_after_a_wait())
    }

    /// Knots that a motion from rest may have: among moving balls one is left for a wait.
    pub(super) fn knots_after_a_wait(&self) -> usize {
        let of_a_wait = usize::from(!self.moving.is_empty());
        self.knots.saturating_sub(of_a_wait)
    }

    /// Times a path from rest to rest with at most so many knots.
    pub(super) fn parameterize(
        &self,
        path: &[Configuration],
        knots: usize,
    ) -> Result<Trajectory, Failure> {
        self.timed(None, path, &with_knots(knots))
    }

    /// Times a path that begins where a robot in this state can rest, from the state on: the path begins while the robot still brakes.
    pub(super) fn time_from(
        &self,
        state: &Knot,
        path: &[Configuration],
    ) -> Result<Trajectory, Failure> {
        self.timed(Some(state), path, &with_knots(self.knots))
    }

    /// A certified motion along a path that begins where a robot in this state can rest, from the state on, if it takes less than
    /// `longest_s`: the path begins while the robot still brakes, with the best of these shares of the acceleration limit for braking, or as
    /// soon as it has braked where there are none.
    pub(crate) fn certified_from(
        &self,
        state: &Knot,
        braking_shares: &[f64],
        path: &[Configuration],
        longest_s: f64,
    ) -> Option<Certified> {
        let joined = self.timed_from(state, braking_shares, path, &with_knots(self.knots));
        let joined = joined.ok().filter(|it| it.duration() < longest_s)?;
        self.certified(joined).ok()
    }

    /// Times a path to rest at its end: from rest, or from a state from which the robot can rest at the path's begin.
    pub(super) fn timed(
        &self,
        state: Option<&Knot>,
        path: &[Configuration],
        options: &ParameterizationOptions,
    ) -> Result<Trajectory, Failure> {
        if let Some(state) = state {
            return self.timed_from(state, &BRAKING_SHARES, path, options);
        }
        let (tendons, limits) = (&self.robot.tendons, &self.limits);
        let timed = PARAMETERIZER.with_borrow_mut(|parameterizer| {
            parameterizer.parameterize(path, tendons, limits, options)
        });
        timed.map_err(|_| Failure::Time)
    }

    /// Times a path to rest at its end from a state from which the robot can rest at the path's begin, with these shares of the
    /// acceleration limit for its braking beside the path, or else all of it.
    fn timed_from(
        &self,
        state: &Knot,
        braking_shares: &[f64],
        path: &[Configuration],
        options: &ParameterizationOptions,
    ) -> Result<Trajectory, Failure> {
        let (tendons, limits) = (&self.robot.tendons, &self.limits);
        let start = MovingStart {
            state: *state,
            path,
            braking_shares,
        };
        let timed = PARAMETERIZER.with_borrow_mut(|parameterizer| {
            parameterizer.parameterize_from(&start, tendons, limits, options)
        });
        timed.map_err(|_| Failure::Time)
    }

    /// Certifies the executed curve: whole body, whole motion, bending, and standing at its end while balls move; its smallest clearance,
    /// section lengths, from obstacles at rest and from the balls that cover those that move.
    pub(crate) fn certify(&self, trajectory: &Trajectory) -> Result<f64, Failure> {
        if !self.keeps_bending(trajectory) {
            return Err(Failure::Bending);
        }
        let (robot, padded) = (self.robot, self.padded);
        let moving = if self.moving.is_empty() {
            Vec::new()
        } else {
            self.covering_for_certain(trajectory)?
        };
        let obstacles = (self.scene, moving.as_slice());
        certified_clearance(robot, padded, obstacles, trajectory, CLEARANCE_TOLERANCE)
            .ok_or(Failure::Collision)
    }

    /// Balls that cover all places where those that move can be during a motion, by its longest stop, and of which it is clear, where a robot
    /// that then stands at its end keeps clear of them, too; [`Failure::Collision`] also where either is not so by a stop that is hardly
    /// ever shorter, which is known sooner.
    fn covering_for_certain(&self, motion: &Trajectory) -> Result<Vec<MovingBall>, Failure> {
        let times = [0.0, motion.duration()];
        let clear_of = |stop_s| {
            if !self
                .moving
                .stands_clear(self.padded, &motion.end(), stop_s, times[1])
            {
                return Err(Failure::Collision);
            }
            let mut covers = self.moving.covers(self.padded, stop_s, times);
            let is_clear = |covering: &Vec<MovingBall>| {
                certify_moving(self.padded, covering, motion, times).is_free()
            };
            covers.find(is_clear).ok_or(Failure::Collision)
        };
        clear_of(SHORTEST_STOP_S)?;
        clear_of(self.moving.longest_stop_s(motion))
    }

    /// By how much a motion bends beyond the limit at most, rad: its Bézier control points do.
    pub(super) fn bending_excess_rad(&self, trajectory: &Trajectory) -> f64 {
        let control = trajectory.segments().flat_map(|segment| segment.control);
        let excess = control.map(|q| self.robot.limit_excess(&q));
        excess.fold(f64::NEG_INFINITY, f64::max)
    }

    fn keeps_bending(&self, trajectory: &Trajectory) -> bool {
        let mut segments = trajectory.segments();
        segments.all(|segment| self.bends_within(&segment, HALVINGS))
    }

    /// The Bézier control points bound the curve, since the allowed bending is convex; those of its halves bound it more closely.
    fn bends_within(&self, segment: &QuinticSegment, halvings: usize) -> bool {
        let is_within = |q: &Configuration| self.robot.limit_excess(q) <= self.bending_slack_rad;
        let [first, .., last] = &segment.control;
        if segment.control.iter().all(is_within) {
            return true;
        }
        let (former, latter) = segment.halves();
        let halves = [former, latter];
        halvings > 0
            && is_within(first)
            && is_within(last)
            && halves
                .iter()
                .all(|half| self.bends_within(half, halvings - 1))
    }

    /// A motion that is certified, with its figures of merit.
    pub(crate) fn certified(&self, trajectory: Trajectory) -> Result<Certified, Failure> {
        let clearance = self.certify(&trajectory)?;
        Ok(self.describe(trajectory, clearance))
    }

    /// A certified motion with its figures of merit; `clearance` in section lengths.
    pub(crate) fn describe(&self, trajectory: Trajectory, clearance: f64) -> Certified {
        let metrics = PathMetrics::of(self.robot, &trajectory, clearance);
        Certified {
            trajectory: trajectory.into(),
            metrics,
        }
    }
}

fn with_knots(knots: usize) -> ParameterizationOptions {
    ParameterizationOptions {
        knots,
        ..ParameterizationOptions::default()
    }
}
