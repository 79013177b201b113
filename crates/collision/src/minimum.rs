//! The smallest clearance of a whole motion, by branch and bound.

use crate::bound::{Displacement, curve_turns};
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
    let mut search = Search {
        robot,
        scene,
        tolerance: tolerance.max(FINEST_TOLERANCE * robot_length),
        attained: f64::INFINITY,
        lower_bound: f64::INFINITY,
    };
    let mut from = search.clearances(&trajectory.knots()[0].position);
    for segment in trajectory.segments() {
        let to = search.clearances(&segment.control[5]);
        search.refine(&segment, &from, &to);
        from = to;
    }
    search.attained.min(search.lower_bound)
}

struct Search<'a> {
    robot: &'a Robot,
    scene: &'a Scene,
    tolerance: f64,
    attained: f64,
    /// Of all that was not refined further.
    lower_bound: f64,
}

impl Search<'_> {
    fn clearances(&mut self, shape: &Configuration) -> [f64; SECTIONS] {
        let backbone = self.robot.backbone(shape);
        let clearances = self
            .scene
            .section_clearances(&backbone, self.robot.tube_radius);
        self.attained = clearances.into_iter().fold(self.attained, f64::min);
        clearances
    }

    /// Between two configurations with clearances a and b, whose motion is bounded by Λ, none is below (a + b − Λ)/2.
    fn refine(&mut self, curve: &QuinticSegment, from: &[f64; SECTIONS], to: &[f64; SECTIONS]) {
        let displacement = Displacement::of_turns(self.robot, curve_turns(curve));
        let lowest = (0..SECTIONS)
            .map(|k| 0.5 * (from[k] + to[k] - displacement.sections[k]))
            .fold(f64::INFINITY, f64::min);
        if lowest >= self.attained - self.tolerance {
            self.lower_bound = self.lower_bound.min(lowest);
            return;
        }
        let (first, second) = curve.halves();
        let between = self.clearances(&second.control[0]);
        self.refine(&first, from, &between);
        self.refine(&second, &between, to);
    }
}
