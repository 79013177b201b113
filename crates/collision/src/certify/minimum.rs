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

/// Smallest clearance over the body and the motion, in the robot's unit of length: never above the true minimum, and below it by
/// at most `tolerance`, and near solids by up to a thousandth of a section and a twentieth of the clearance more. +∞ in an empty
/// scene.
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

/// Certifies the executed curve for `padded`, the same robot with thicker tubes, and finds the [`minimum_clearance`] of the robot itself,
/// in one search. None where the padded robot touches something, or comes too close to decide; +∞ in an empty scene.
///
/// Distances to solids are as accurate as the clearance of the padded robot needs. `tolerance`: by how much the result may be below the
/// true minimum, a length.
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

/// The lower bound, or −∞ where it is NaN.
fn or_unbounded(lowest: f64) -> f64 {
    if lowest.is_nan() {
        f64::NEG_INFINITY
    } else {
        lowest
    }
}

/// Segments of a motion that follow each other, at least one, with their bounds.
#[derive(Clone, Copy)]
struct Segments<'a> {
    curves: &'a [QuinticSegment],
    bounds: &'a [MotionBound],
}

impl Segments<'_> {
    fn split_at(&self, count: usize) -> (Self, Self) {
        let curves = self.curves.split_at(count);
        let bounds = self.bounds.split_at(count);
        let part = |curves, bounds| Self { curves, bounds };
        (part(curves.0, bounds.0), part(curves.1, bounds.1))
    }
}

/// An interval of the motion.
struct Interval<'a> {
    segments: Segments<'a>,
    from: BodyState,
    to: BodyState,
    /// Lower bounds of the clearance of each section during the interval; +∞ for a section that is not refined further.
    lowest: [f64; SECTIONS],
}

impl Interval<'_> {
    fn least(&self) -> f64 {
        self.lowest.into_iter().fold(f64::INFINITY, f64::min)
    }
}

/// A branch-and-bound search for the smallest clearance.
struct Search<'a> {
    /// The robot whose clearances are bounded, with padded tubes.
    padded: &'a Robot,
    scene: &'a Scene,
    reach: [f64; SECTIONS],
    /// How much thicker the padded tubes are than those whose clearance is sought, by section, a length.
    padding: [f64; SECTIONS],
    tolerance: f64,
    /// Smallest clearance that was measured.
    attained: f64,
    /// Lower bound of the clearances in all intervals and of all sections that were not refined further.
    lower_bound: f64,
    /// Whether the padded robot is to be certified: the search ends where it touches something, or may after all bisections.
    must_be_free: bool,
    /// False once the padded robot cannot be certified.
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

    /// Smallest clearance of the motion, once it was searched.
    fn least(&self) -> f64 {
        self.attained.min(self.lower_bound)
    }

    fn whole(&mut self, trajectory: &Trajectory) {
        if self.scene.is_empty() {
            return;
        }
        let curves: Vec<QuinticSegment> = trajectory.segments().collect();
        let bounds: Vec<MotionBound> = curves.iter().map(MotionBound::of_curve).collect();
        let segments = Segments {
            curves: &curves,
            bounds: &bounds,
        };
        let from = self.measure(&curves[0].control[0], &EVERY_SECTION);
        let to = self.measure(&curves[curves.len() - 1].control[5], &EVERY_SECTION);
        let whole = self.interval(segments, from, to);
        self.refine(&whole, DEPTH);
    }

    fn measure(&mut self, configuration: &Configuration, chosen: &Chosen) -> BodyState {
        let at = BodyState::new(self.padded, self.scene, configuration, chosen);
        for (clearance, padding) in at.clearances.iter().zip(&self.padding) {
            self.attained = self.attained.min(clearance + padding);
        }
        self.is_free &= !(self.must_be_free && at.touches());
        at
    }

    fn interval<'b>(&self, segments: Segments<'b>, from: BodyState, to: BodyState) -> Interval<'b> {
        let bound = MotionBound::of_successive(segments.bounds);
        let lowest = lowest(self.padded, &bound, &from, &to, &self.reach);
        Interval {
            segments,
            from,
            to,
            lowest,
        }
    }

    /// Halves an interval until no part of it can be below the smallest clearance measured, nor touch anything where the robot is
    /// to be certified; the half with the lower bound first, where the smaller clearances are.
    fn refine(&mut self, interval: &Interval<'_>, depth: u32) {
        let touching = may_touch(interval.lowest).map(|may| may && self.must_be_free);
        let lowest: [f64; SECTIONS] = std::array::from_fn(|k| interval.lowest[k] + self.padding[k]);
        let enough = self.attained - self.tolerance;
        let open = std::array::from_fn(|k| touching[k] || lowest[k] < enough);
        let closed = (0..SECTIONS).filter(|k| !open[*k]);
        let closed = closed.map(|k| or_unbounded(lowest[k]));
        self.lower_bound = closed.fold(self.lower_bound, f64::min);
        if open == NO_SECTION || !self.is_free {
            return;
        }
        let [curve] = interval.segments.curves else {
            return self.divide(&interval.segments, interval, &open, depth);
        };
        // Where only the tolerance is missed, halving goes on: the bounds come as near to what is attained as one likes.
        if depth == 0 && touching != NO_SECTION {
            self.is_free = false;
            return;
        }
        let halves: [QuinticSegment; 2] = curve.halves().into();
        let segments = Segments {
            curves: &halves,
            bounds: &[&halves[0], &halves[1]].map(MotionBound::of_curve),
        };
        self.divide(&segments, interval, &open, depth.saturating_sub(1));
    }

    fn divide(
        &mut self,
        segments: &Segments<'_>,
        interval: &Interval<'_>,
        open: &Chosen,
        depth: u32,
    ) {
        let (first, second) = segments.split_at(segments.curves.len() / 2);
        let between = self.measure(&second.curves[0].control[0], open);
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
