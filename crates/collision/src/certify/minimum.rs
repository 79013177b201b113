//! The smallest clearance of a whole motion, by branch and bound, alone or together with its certificate.

use crate::certify::body_state::{BodyState, lowest, may_touch, reach};
use crate::certify::motion_bound::MotionBound;
use crate::certify::verdict::DEPTH;
use crate::distance::chosen_sections::{Chosen, EVERY_SECTION, NO_SECTION};
use crate::scene::static_scene::Scene;
use pcc_model::{Configuration, Robot, SECTIONS};
use trajectory::{QuinticSegment, Trajectory};

/// Finest tolerance, as a part of the robot's length: below it the search would only measure rounding.
const FINEST_TOLERANCE: f64 = 1e-6;

/// Smallest clearance over the body and the motion, in the robot's unit of length: never above the true minimum, and at most
/// `tolerance` below it, or below what the distances to solids tell of it (they are up to a thousandth of a section and a
/// twentieth of the clearance too low). +∞ in an empty scene.
///
/// `tolerance` is a length, and taken as 1e-6 of the robot's length if it is smaller.
#[must_use]
pub fn minimum_clearance(
    robot: &Robot,
    scene: &Scene,
    trajectory: &Trajectory,
    tolerance: f64,
) -> f64 {
    let mut search = Search::new(robot, robot, scene, tolerance);
    search.whole(trajectory);
    search.least()
}

/// Certifies the executed curve for `padded`, the same robot with thicker tubes, and finds the [`minimum_clearance`] of the robot
/// itself, in one search. None where the padded robot touches something, or there is too little room to tell; +∞ in an empty scene.
///
/// The distances to solids are told as accurately as the clearance of the padded robot needs.
#[must_use]
pub fn certified_clearance(
    robot: &Robot,
    padded: &Robot,
    scene: &Scene,
    trajectory: &Trajectory,
    tolerance: f64,
) -> Option<f64> {
    debug_assert_eq!(robot.section_lengths, padded.section_lengths);
    let mut search = Search {
        must_be_free: true,
        ..Search::new(robot, padded, scene, tolerance)
    };
    search.whole(trajectory);
    search.is_free.then(|| search.least())
}

/// What is not a number bounds nothing.
fn number(lowest: f64) -> f64 {
    if lowest.is_nan() {
        f64::NEG_INFINITY
    } else {
        lowest
    }
}

/// Segments of a motion that follow each other; at least one.
#[derive(Clone, Copy)]
struct Run<'a> {
    segments: &'a [QuinticSegment],
    bounds: &'a [MotionBound],
}

impl Run<'_> {
    fn split_at(&self, count: usize) -> (Self, Self) {
        let (segments, later_segments) = self.segments.split_at(count);
        let (bounds, later_bounds) = self.bounds.split_at(count);
        let later = Self {
            segments: later_segments,
            bounds: later_bounds,
        };
        (Self { segments, bounds }, later)
    }
}

/// An interval of the motion.
struct Interval<'a> {
    run: Run<'a>,
    from: BodyState,
    to: BodyState,
    /// Lower bounds of the clearance of each section during it; +∞ for a section that is not refined further.
    lowest: [f64; SECTIONS],
}

impl Interval<'_> {
    fn least(&self) -> f64 {
        self.lowest.into_iter().fold(f64::INFINITY, f64::min)
    }
}

struct Search<'a> {
    /// With the tubes that bounds are told for.
    padded: &'a Robot,
    scene: &'a Scene,
    reach: [f64; SECTIONS],
    /// How much thicker these are than those whose clearance is sought.
    padding: [f64; SECTIONS],
    tolerance: f64,
    /// Smallest clearance that was seen.
    attained: f64,
    /// Of the clearances in all intervals and of all sections that were not refined further.
    lower_bound: f64,
    /// Whether the padded robot is to be certified: the search ends where it touches something, or may after all bisections.
    must_be_free: bool,
    /// False once it cannot be certified.
    is_free: bool,
}

impl<'a> Search<'a> {
    fn new(robot: &Robot, padded: &'a Robot, scene: &'a Scene, tolerance: f64) -> Self {
        let robot_length: f64 = robot.section_lengths.iter().sum();
        Self {
            padded,
            scene,
            reach: reach(padded, scene),
            padding: std::array::from_fn(|k| padded.tube_radii[k] - robot.tube_radii[k]),
            tolerance: tolerance.max(FINEST_TOLERANCE * robot_length),
            attained: f64::INFINITY,
            lower_bound: f64::INFINITY,
            must_be_free: false,
            is_free: true,
        }
    }

    /// Smallest clearance of what was searched.
    fn least(&self) -> f64 {
        self.attained.min(self.lower_bound)
    }

    fn whole(&mut self, trajectory: &Trajectory) {
        if self.scene.is_empty() {
            return;
        }
        let segments: Vec<QuinticSegment> = trajectory.segments().collect();
        let bounds: Vec<MotionBound> = segments.iter().map(MotionBound::of_curve).collect();
        let run = Run {
            segments: &segments,
            bounds: &bounds,
        };
        let from = self.look(&segments[0].control[0], &EVERY_SECTION);
        let to = self.look(&segments[segments.len() - 1].control[5], &EVERY_SECTION);
        let whole = self.interval(run, from, to);
        self.refine(&whole, DEPTH);
    }

    fn look(&mut self, shape: &Configuration, chosen: &Chosen) -> BodyState {
        let backbone = self.padded.backbone(shape);
        let tubes = &self.padded.tube_radii;
        let at = BodyState::new(self.scene, shape, &backbone, tubes, chosen);
        for (clearance, padding) in at.clearances.iter().zip(&self.padding) {
            self.attained = self.attained.min(clearance + padding);
        }
        self.is_free &= !(self.must_be_free && at.touches());
        at
    }

    fn interval<'b>(&self, run: Run<'b>, from: BodyState, to: BodyState) -> Interval<'b> {
        let bound = run.bounds.iter().fold(MotionBound::REST, MotionBound::then);
        let lowest = lowest(self.padded, &bound, &from, &to, &self.reach);
        Interval {
            run,
            from,
            to,
            lowest,
        }
    }

    /// Halves an interval until what is left cannot touch anything, where that is asked for, nor be below what was attained; the
    /// lower half first, which attains more.
    fn refine(&mut self, interval: &Interval<'_>, depth: u32) {
        let touching = may_touch(interval.lowest).map(|may| may && self.must_be_free);
        let lowest: [f64; SECTIONS] = std::array::from_fn(|k| interval.lowest[k] + self.padding[k]);
        let enough = self.attained - self.tolerance;
        let open = std::array::from_fn(|k| touching[k] || lowest[k] < enough);
        let closed = (0..SECTIONS).filter(|k| !open[*k]);
        let closed = closed.map(|k| number(lowest[k]));
        self.lower_bound = closed.fold(self.lower_bound, f64::min);
        if open == NO_SECTION || !self.is_free {
            return;
        }
        let [segment] = interval.run.segments else {
            return self.divide(&interval.run, interval, &open, depth);
        };
        // Where only the tolerance is missed, halving goes on: the bounds come as near to what is attained as one likes.
        if depth == 0 && touching != NO_SECTION {
            self.is_free = false;
            return;
        }
        let halves: [QuinticSegment; 2] = segment.halves().into();
        let run = Run {
            segments: &halves,
            bounds: &[&halves[0], &halves[1]].map(MotionBound::of_curve),
        };
        self.divide(&run, interval, &open, depth.saturating_sub(1));
    }

    fn divide(&mut self, run: &Run<'_>, interval: &Interval<'_>, open: &Chosen, depth: u32) {
        let (first, second) = run.split_at(run.segments.len() / 2);
        let between = self.look(&second.segments[0].control[0], open);
        let first = self.interval(first, interval.from, between);
        let second = self.interval(second, between, interval.to);
        let (lower, higher) = if second.least() < first.least() {
            (second, first)
        } else {
            (first, second)
        };
        self.refine(&lower, depth);
        self.refine(&higher, depth);
    }
}
