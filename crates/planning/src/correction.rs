//! Analytic correction: smooth least-squares pushes out of obstacles and back inside the bending limits.
//!
//! Each round takes the exact nearest body point of every waypoint and ball that is closer than the margin,
//! linearises the clearance by the envelope theorem (docs/robot.md "Exact geometry"), and solves for the smooth change
//! that restores it. Both ends stay exactly where they are.

use crate::basis::{SineBasis, SmoothLeastSquares, UNKNOWNS};
use crate::path::{WAYPOINTS, project};
use collision::{Contact, Scene};
use pcc_model::{Configuration, DOF, Robot, SECTIONS};

/// Rounds of pushes: a count, so that answers do not depend on time.
const ROUNDS: usize = 8;
/// Bending is pulled back from this far below the limit, rad.
const LIMIT_MARGIN_RAD: f64 = 0.01;
/// Largest change of a waypoint in one round, rad.
const LARGEST_STEP_RAD: f64 = 0.5;
/// Cost of a coefficient, and how it grows with the fourth power of its frequency.
const CHANGE_COST: f64 = 1e-3;

/// What a correction has come to, at the waypoints.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Correction {
    /// No waypoint touches an obstacle.
    Clear,
    /// One still does: no motion along this path can be certified.
    Touching,
}

/// Pushes a path (64 waypoints, radians) out of the scene to `margin` (section lengths) beyond the tube.
pub(crate) fn correct(
    robot: &Robot,
    scene: &Scene,
    basis: &SineBasis,
    margin: f64,
    path: &mut [Configuration],
) -> Correction {
    project(robot, path);
    let damping = damping();
    let mut contacts = Vec::new();
    let mut problem = SmoothLeastSquares::new();
    for _ in 0..ROUNDS {
        problem.clear();
        let deepest = push_rows(robot, scene, margin, path, &mut contacts, &mut problem);
        if deepest >= 0.5 * margin {
            return Correction::Clear;
        }
        let Some(solution) = problem.solve(basis, &damping, &[0.0; UNKNOWNS]) else {
            break;
        };
        apply(basis, &solution, path);
        project(robot, path);
    }
    let touches = |q| scene.clearance(&robot.backbone(q), robot.tube_radius) < 0.0;
    if path.iter().any(touches) {
        Correction::Touching
    } else {
        Correction::Clear
    }
}

fn damping() -> [f64; UNKNOWNS] {
    std::array::from_fn(|i| CHANGE_COST * (1.0 + ((i / DOF + 1) as f64 / 4.0).powi(4)))
}

fn push_rows(
    robot: &Robot,
    scene: &Scene,
    margin: f64,
    path: &[Configuration],
    contacts: &mut Vec<Contact>,
    problem: &mut SmoothLeastSquares,
) -> f64 {
    let mut deepest = f64::INFINITY;
    for (h, waypoint) in path.iter().enumerate().take(WAYPOINTS - 1).skip(1) {
        limit_rows(robot, h, waypoint, problem);
        let backbone = robot.backbone(waypoint);
        contacts.clear();
        scene.contacts_within(&backbone, robot.tube_radius, margin, contacts);
        for contact in contacts.iter() {
            let gradient = backbone
                .point_jacobian(contact.section, contact.fraction)
                .transpose()
                * contact.normal;
            problem.push(h, &gradient, margin - contact.clearance, 1.0);
            deepest = deepest.min(contact.clearance);
        }
    }
    deepest
}

/// Adds a row for every section of a waypoint that is bent to within the limit margin.
pub(crate) fn limit_rows(
    robot: &Robot,
    h: usize,
    waypoint: &Configuration,
    problem: &mut SmoothLeastSquares,
) {
    let allowed = robot.bending_limit - LIMIT_MARGIN_RAD;
    for (section, angle) in robot
        .bending_angles(waypoint)
        .into_iter()
        .enumerate()
        .take(SECTIONS)
    {
        if angle > allowed {
            let mut gradient = Configuration::zeros();
            gradient[2 * section] = waypoint[2 * section] / angle;
            gradient[2 * section + 1] = waypoint[2 * section + 1] / angle;
            problem.push(h, &gradient, allowed - angle, 1.0);
        }
    }
}

fn apply(basis: &SineBasis, coefficients: &[f64], path: &mut [Configuration]) {
    let changes: Vec<Configuration> = (0..WAYPOINTS)
        .map(|h| basis.change(h, coefficients))
        .collect();
    let largest = changes.iter().map(Configuration::norm).fold(0.0, f64::max);
    let scale = (LARGEST_STEP_RAD / largest.max(f64::MIN_POSITIVE)).min(1.0);
    for (waypoint, change) in path.iter_mut().zip(&changes).take(WAYPOINTS - 1).skip(1) {
        *waypoint += change * scale;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path::straight_path;
    use crate::scenes::unit_robot;
    use collision::Ball;
    use pcc_model::Point;

    #[test]
    fn a_path_through_a_ball_is_pushed_out_and_keeps_its_ends() {
        let robot = unit_robot();
        let start = Configuration::from_column_slice(&[0.0, 0.6, 0.0, 0.6, 0.0, 0.6]);
        let end = -start;
        let ball = Ball {
            centre: Point::new(0.15, 0.1, 2.9),
            radius: 0.3,
        };
        let scene = Scene::new(vec![ball]).unwrap();
        let mut path = straight_path(&start, &end);
        let deepest = |path: &[Configuration]| {
            path.iter()
                .map(|q| scene.clearance(&robot.backbone(q), robot.tube_radius))
                .fold(f64::INFINITY, f64::min)
        };
        assert!(deepest(&path) < -0.2, "the straight path collides");
        let corrected = correct(&robot, &scene, &SineBasis::new(), 0.04, &mut path);
        assert_eq!(corrected, Correction::Clear);
        assert!(deepest(&path) >= 0.02);
        assert_eq!((path[0], path[63]), (start, end));
    }
}
