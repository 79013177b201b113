//! Attaching the ends of sampled paths: the first waypoint to the start, the last one to the goal.

use crate::goals::inverse_kinematics::{is_solved, solve_tip};
use crate::path::waypoints::parameter;
use crate::problem::{Goal, Problem};
use pcc_model::{Configuration, UnitRobot};

/// Moves the first waypoint to the start and the last one to the goal's nearest configuration, the others along with weight u².
///
/// Returns whether the goal is reached; a path whose end is too far from any solution keeps its nearest configuration.
pub(crate) fn attach(robot: &UnitRobot, problem: &Problem, path: &mut [Configuration]) -> bool {
    let last = path[path.len() - 1];
    let (end, reached) = match &problem.goal {
        Goal::Configuration(configuration) => (*configuration, true),
        Goal::Tip(target) => {
            let (end, distance) = solve_tip(robot, target, &robot.project_to_limits(&last));
            (end, is_solved(distance))
        }
    };
    let change = end - last;
    for (h, waypoint) in path.iter_mut().enumerate() {
        *waypoint += change * parameter(h).powi(2);
    }
    path[0] = problem.start;
    reached
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::unit_robot;
    use crate::moving_obstacles::MovingObstacles;
    use crate::path::waypoints::straight_path;
    use collision::Scene;
    use pcc_model::Point;

    #[test]
    fn both_ends_are_exact_and_what_cannot_be_reached_is_said() {
        let robot = unit_robot();
        let near = Configuration::from_fn(|i, _| 0.4 - 0.15 * i as f64);
        let mut problem = Problem {
            start: Configuration::repeat(1e-3),
            goal: Goal::Tip(robot.tip(&near)),
            scene: Scene::default(),
            moving: MovingObstacles::default(),
        };
        let drawn = straight_path(&Configuration::zeros(), &near.map(|v| v + 0.05));
        let mut path = drawn.clone();
        assert!((robot.tip(&path[63]) - robot.tip(&near)).norm() > 0.05);
        assert!(attach(&robot, &problem, &mut path));
        assert!((robot.tip(&path[63]) - robot.tip(&near)).norm() < 1e-7);
        assert_eq!(path[0], problem.start);
        assert!((path[8] - drawn[8]).norm() < 0.02 * (path[63] - drawn[63]).norm());
        problem.goal = Goal::Tip(Point::new(0.0, 0.0, 5.0));
        assert!(!attach(&robot, &problem, &mut path));
        problem.goal = Goal::Configuration(near);
        assert!(attach(&robot, &problem, &mut path));
        assert!((path[63] - near).norm() < 1e-12);
    }
}
