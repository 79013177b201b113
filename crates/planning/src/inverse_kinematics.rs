//! Tip inverse kinematics by damped Newton steps inside the bending discs.

use nalgebra::{Cholesky, Matrix3, Matrix3x6, Matrix6x3, Vector2, Vector3};
use pcc_model::{Backbone, Configuration, Point, Robot, SECTIONS};

type TipJacobian = Matrix3x6<f64>;

/// Iterations of one seed: a count, so that answers do not depend on time.
const ITERATIONS: usize = 40;
/// Damping λ of the pseudo-inverse (docs/evaluation.md "Targets").
const DAMPING: f64 = 1e-4;
/// A section bent this near to its limit is at it, rad.
const AT_LIMIT_RAD: f64 = 1e-9;
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
        let Some(next) = newton_step(robot, &shape, &backbone, &error) else {
            return (shape, distance);
        };
        shape = next;
    }
    let distance = (target - robot.tip(&shape)).norm();
    (shape, distance)
}

/// The shape within the limits after one step that moves the tip by `error`; none if the step cannot be computed.
///
/// Where a section would leave its disc it may only turn: clipped steps would come nearer by a share at a time.
pub(crate) fn newton_step(
    robot: &Robot,
    shape: &Configuration,
    backbone: &Backbone,
    error: &Vector3<f64>,
) -> Option<Configuration> {
    let mut jacobian = backbone.tip_jacobian();
    let mut step = damped_step(&jacobian, &jacobian.transpose(), error)?;
    if hold_limits(robot, shape, &step, &mut jacobian) {
        step = damped_step(&jacobian, &jacobian.transpose(), error).unwrap_or(step);
    }
    Some(robot.project_to_limits(&(shape + step)))
}

/// The change of least norm that moves the tip by `error`, where `weighted` is the Jacobian's transpose with each row
/// times the part that this component may take.
pub(crate) fn damped_step(
    jacobian: &TipJacobian,
    weighted: &Matrix6x3<f64>,
    error: &Vector3<f64>,
) -> Option<Configuration> {
    let damping = DAMPING * error.norm().min(1.0);
    let normal = jacobian * weighted + Matrix3::identity() * damping;
    Cholesky::new(normal).map(|factor| weighted * factor.solve(error))
}

/// Takes from the Jacobian the bending of the sections that are at their limit and that the step would bend further.
///
/// Returns whether there are any.
fn hold_limits(
    robot: &Robot,
    shape: &Configuration,
    step: &Configuration,
    jacobian: &mut TipJacobian,
) -> bool {
    let mut any = false;
    for section in 0..SECTIONS {
        let bend: Vector2<f64> = shape.fixed_rows::<2>(2 * section).into_owned();
        let angle = bend.norm();
        let outwards = bend.dot(&step.fixed_rows::<2>(2 * section)) > 0.0;
        if outwards && angle >= robot.bending_limit - AT_LIMIT_RAD {
            let radial = bend / angle;
            let mut columns = jacobian.fixed_columns_mut::<2>(2 * section);
            let held = &columns * radial * radial.transpose();
            columns -= held;
            any = true;
        }
    }
    any
}

/// Whether a residual of [`solve_tip`] counts as reached.
pub(crate) fn is_solved(distance: f64) -> bool {
    distance < 1e-7
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenes::{random_configuration, unit_robot};
    use rand::SeedableRng;
    use rand_pcg::Pcg64;

    #[test]
    fn shapes_at_the_bending_limit_are_reached() {
        let robot = unit_robot();
        let mut rng = Pcg64::seed_from_u64(1);
        let reached = (0..200).filter(|case| {
            let mut shape = random_configuration(&robot, &mut rng);
            let section = 2 * (case % SECTIONS);
            let bend = shape.fixed_rows::<2>(section).normalize() * robot.bending_limit;
            shape.fixed_rows_mut::<2>(section).copy_from(&bend);
            let near = shape * 0.95 + random_configuration(&robot, &mut rng) * 0.05;
            let (found, distance) = solve_tip(&robot, &robot.tip(&shape), &near);
            assert!(robot.limit_excess(&found) < 1e-12);
            is_solved(distance)
        });
        assert_eq!(reached.count(), 200);
    }
}
