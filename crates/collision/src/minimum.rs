//! The smallest clearance of a whole motion, by branch and bound.

use crate::bound::Turning;
use crate::certificate::{Instant, lowest, reach};
use crate::clearance::{Chosen, EVERY_SECTION, NO_SECTION};
use crate::scene::Scene;
use pcc_model::{Configuration, Robot, SECTIONS};
use trajectory::{QuinticSegment, Trajectory};

/// Finest tolerance, as a part of the robot's length: below it the search would only measure rounding.
const FINEST_TOLERANCE: f64 = 1e-6;

/// Smallest clearance over the body and the motion: at most `tolerance` below the true minimum, never above it.
///
/// `tolerance` is a length, and taken as 1e-6 of the robot's length if it is smaller. +∞ in an empty scene.
#[must_use]
pub fn minimum_clearance(
    robot: &Robot,
    scene: &Scene,
    trajectory: &Trajectory,
    tolerance: f64,
) -> f64 {
    if scene.is_empty() {
        return f64::INFINITY;
    }
    let robot_length: f64 = robot.section_lengths.iter().sum();
    let segments: Vec<QuinticSegment> = trajectory.segments().collect();
    let turnings: Vec<Turning> = segments.iter().map(Turning::of_curve).collect();
    let mut search = Search {
        robot,
        scene,
        reach: reach(robot, scene),
        tolerance: tolerance.max(FINEST_TOLERANCE * robot_length),
        attained: f64::INFINITY,
        lower_bound: f64::INFINITY,
    };
    let run = Run {
        segments: &segments,
        turnings: &turnings,
    };
    let from = search.look(&segments[0].control[0], &EVERY_SECTION);
    let to = search.look(&segments[segments.len() - 1].control[5], &EVERY_SECTION);
    let whole = search.interval(run, from, to);
    search.refine(&whole);
    search.attained.min(search.lower_bound)
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
    turnings: &'a [Turning],
}

impl Run<'_> {
    fn split_at(&self, count: usize) -> (Self, Self) {
        let (segments, later_segments) = self.segments.split_at(count);
        let (turnings, later_turnings) = self.turnings.split_at(count);
        let later = Self {
            segments: later_segments,
            turnings: later_turnings,
        };
        (Self { segments, turnings }, later)
    }
}

/// An interval of the motion.
struct Interval<'a> {
    run: Run<'a>,
    from: Instant,
    to: Instant,
    /// Lower bounds of the clearance of each section during it; +∞ for a section that is not refined further.
    lowest: [f64; SECTIONS],
}

impl Interval<'_> {
    fn least(&self) -> f64 {
        self.lowest.into_iter().fold(f64::INFINITY, f64::min)
    }
}

struct Search<'a> {
    robot: &'a Robot,
    scene: &'a Scene,
    reach: [f64; SECTIONS],
    tolerance: f64,
    attained: f64,
    /// Of all intervals and sections that were not refined further.
    lower_bound: f64,
}

impl Search<'_> {
    fn look(&mut self, shape: &Configuration, chosen: &Chosen) -> Instant {
        let backbone = self.robot.backbone(shape);
        let at = Instant::new(self.scene, shape, &backbone, &self.robot.tube_radii, chosen);
        self.attained = at.clearances.into_iter().fold(self.attained, f64::min);
        at
    }

    fn interval<'a>(&self, run: Run<'a>, from: Instant, to: Instant) -> Interval<'a> {
        let turning = run.turnings.iter().fold(Turning::REST, Turning::then);
        let lowest = lowest(self.robot, &turning, &from, &to, &self.reach);
        Interval {
            run,
            from,
            to,
            lowest,
        }
    }

    /// Halves an interval until what is left cannot be below what was attained; the lower half first, which attains more.
    fn refine(&mut self, interval: &Interval<'_>) {
        let open = interval
            .lowest
            .map(|lowest| lowest < self.attained - self.tolerance);
        let closed = (0..SECTIONS).filter(|k| !open[*k]);
        let closed = closed.map(|k| number(interval.lowest[k]));
        self.lower_bound = closed.fold(self.lower_bound, f64::min);
        if open == NO_SECTION {
            return;
        }
        if let [segment] = interval.run.segments {
            let halves: [QuinticSegment; 2] = segment.halves().into();
            let run = Run {
                segments: &halves,
                turnings: &[&halves[0], &halves[1]].map(Turning::of_curve),
            };
            self.divide(&run, interval, &open);
        } else {
            self.divide(&interval.run, interval, &open);
        }
    }

    fn divide(&mut self, run: &Run<'_>, interval: &Interval<'_>, open: &Chosen) {
        let (first, second) = run.split_at(run.segments.len() / 2);
        let between = self.look(&second.segments[0].control[0], open);
        let first = self.interval(first, interval.from, between);
        let second = self.interval(second, between, interval.to);
        let (lower, higher) = if second.least() < first.least() {
            (second, first)
        } else {
            (first, second)
        };
        self.refine(&lower);
        self.refine(&higher);
    }
}
