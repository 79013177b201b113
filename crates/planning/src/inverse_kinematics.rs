//! Tip inverse kinematics by damped Newton steps inside the bending discs.

use nalgebra::{Cholesky, Matrix3};
use pcc_model::{Configuration, Point, Robot};

/// Iterations of one seed: a count, so that answers do not depend on time.
const ITERATIONS: usize = 40;
/// Damping λ of the pseudo-inverse (docs/evaluation.md "Targets").
const DAMPING: f64 = 1e-4;
/// Tip residual taken as solved, section lengths.
const SOLVED: f64 = 1e-9;

/// Solves for a shape within the limits whose tip is at `target` (base frame, section lengths), from `seed`.
///
/// Returns the shape and the remaining tip distance; a distance above 1e-9 means that this seed did not reach it.
#[must_use]
pub fn solve_tip(robot: &Robot, target: &Point, seed: &Configuration) -> (Configuration, f64) {
    let mut shape = *seed;
    let mut previous = f64::INFINITY;
    for iteration in 0..ITERATIONS {
        let backbone = robot.backbone(&shape);
        let error = target - backbone.tip();
        let distance = error.norm();
        let stalled = iteration > 12 && distance > 0.98 * previous && distance > 1e-3;
        if distance < SOLVED || stalled {
            return (shape, distance);
        }
        previous = distance;
        let jacobian = backbone.tip_jacobian();
        let normal =
            jacobian * jacobian.transpose() + Matrix3::identity() * (DAMPING * distance.min(1.0));
        let Some(factor) = Cholesky::new(normal) else {
            return (shape, distance);
        };
        shape = robot.project_to_limits(&(shape + jacobian.transpose() * factor.solve(&error)));
    }
    let distance = (target - robot.tip(&shape)).norm();
    (shape, distance)
}

/// Whether a residual of [`solve_tip`] counts as reached.
pub(crate) fn is_solved(distance: f64) -> bool {
    distance < 1e-7
}
