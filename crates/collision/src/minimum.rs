//! The smallest clearance of a whole motion, by branch and bound.

use crate::bound::Turning;
use crate::certificate::{Instant, lowest, reach};
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
    let from = search.look(&segments[0].control[0]);
    let to = search.look(&segments[segments.len() - 1].control[5]);
    let whole = search.interval(run, from, to);
    search.refine(&whole);
    search.attained.min(search.lower_bound)
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
    /// Lower bound of the clearance during it.
    lowest: f64,
}

struct Search<'a> {
    robot: &'a Robot,
    scene: &'a Scene,
    reach: [f64; SECTIONS],
    tolerance: f64,
    attained: f64,
    /// Of all that was not refined further.
    lower_bound: f64,
}

impl Search<'_> {
    fn look(&mut self, shape: &Configuration) -> Instant {
        let backbone = self.robot.backbone(shape);
        let at = Instant::new(self.scene, shape, &backbone, &self.robot.tube_radii);
        self.attained = at.clearances.into_iter().fold(self.attained, f64::min);
        at
    }

    fn interval<'a>(&self, run: Run<'a>, from: Instant, to: Instant) -> Interval<'a> {
        let turning = run.turnings.iter().fold(Turning::REST, Turning::then);
        let lowest = lowest(self.robot, &turning, &from, &to, &self.reach)
            .into_iter()
            .fold(f64::INFINITY, f64::min);
        Interval {
            run,
            from,
            to,
            lowest,
        }
    }

    /// Halves an interval until what is left cannot be below what was attained; the lower half first, which attains more.
    fn refine(&mut self, interval: &Interval<'_>) {
        if interval.lowest >= self.attained - self.tolerance {
            self.lower_bound = self.lower_bound.min(interval.lowest);
            return;
        }
        if let [segment] = interval.run.segments {
            let halves: [QuinticSegment; 2] = segment.halves().into();
            let run = Run {
                segments: &halves,
                turnings: &[&halves[0], &halves[1]].map(Turning::of_curve),
            };
            self.divide(&run, interval);
        } else {
            self.divide(&interval.run, interval);
        }
    }

    fn divide(&mut self, run: &Run<'_>, interval: &Interval<'_>) {
        let (first, second) = run.split_at(run.segments.len() / 2);
        let between = self.look(&second.segments[0].control[0]);
        let first = self.interval(first, interval.from, between);
        let second = self.interval(second, between, interval.to);
        let (lower, higher) = if second.lowest < first.lowest {
            (second, first)
        } else {
            (first, second)
        };
        self.refine(&lower);
        self.refine(&higher);
    }
}
