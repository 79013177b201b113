//! The smallest clearance of a whole motion, by branch and bound.

use crate::certificate::segment_displacement;
use crate::scene::Scene;
use pcc_model::{Configuration, Robot};
use trajectory::{QuinticSegment, Trajectory};

/// Smallest clearance over the body and the motion, at most `tolerance` above the true minimum; infinite in an empty scene.
///
/// Between two configurations with clearances a and b that are Λ apart, no clearance is below (a + b − Λ)/2.
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
    let at = |q: &Configuration| scene.clearance(&robot.backbone(q), robot.tube_radius);
    let ends: Vec<f64> = trajectory.knots().iter().map(|k| at(&k.position)).collect();
    let mut least = ends.iter().copied().fold(f64::INFINITY, f64::min);
    for (i, segment) in trajectory.segments().enumerate() {
        refine(
            robot,
            &at,
            &segment,
            [ends[i], ends[i + 1]],
            tolerance,
            &mut least,
        );
    }
    least
}

fn refine(
    robot: &Robot,
    at: &impl Fn(&Configuration) -> f64,
    segment: &QuinticSegment,
    ends: [f64; 2],
    tolerance: f64,
    least: &mut f64,
) {
    let lowest = 0.5 * (ends[0] + ends[1] - segment_displacement(robot, segment).largest());
    if lowest >= *least - tolerance {
        return;
    }
    let (first, second) = segment.halves();
    let middle = at(&second.control[0]);
    *least = least.min(middle);
    refine(robot, at, &first, [ends[0], middle], tolerance, least);
    refine(robot, at, &second, [middle, ends[1]], tolerance, least);
}
