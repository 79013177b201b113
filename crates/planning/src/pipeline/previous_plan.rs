//! Going on from a previous plan: what remains of its motions, brought onto the new start and the new goal.
//!
//! The configurations that the previous plan ended in stay where they are or move with the goal, so that a robot that replans
//! while it moves does not change its mind about where to pass; its paths are what the sampler starts from.

use crate::goals::inverse_kinematics::configuration_near;
use crate::path::waypoints::{Waypoints, parameter, resample};
use crate::pipeline::context::Proposal;
use crate::pipeline::selection::is_worth_a_change;
use crate::plan::Draw;
use crate::problem::Problem;
use crate::request::PreviousPlan;
use codes::Source;
use pcc_model::{Configuration, UnitRobot};

/// A goal configuration that would have to move farther than this to the new goal is not kept, rad.
const SAME_CONFIGURATION_RAD: f64 = 0.5;
/// Goal configurations nearer than this to one that is kept are not kept, rad.
const SEPARATION_RAD: f64 = 0.1;

/// What remains of a path: it begins at the new start and ends in a clear configuration that reaches the new goal.
#[derive(Clone, Debug)]
pub(super) struct RemainingPath {
    pub(crate) path: Waypoints,
    /// Whether the robot follows the path.
    pub(crate) followed: bool,
}

impl RemainingPath {
    pub(crate) fn end(&self) -> Configuration {
        self.path[self.path.len() - 1]
    }
}

/// What remains of at most `count` paths of a previous plan, the followed one first.
pub(super) fn remaining_paths(
    previous: &PreviousPlan,
    robot: &UnitRobot,
    problem: &Problem,
    count: usize,
) -> Vec<RemainingPath> {
    let others = (0..previous.paths.len()).filter(|&i| Some(i) != previous.followed);
    let order = previous.followed.into_iter().chain(others);
    let mut remaining: Vec<RemainingPath> = Vec::new();
    for index in order.filter(|&i| i < previous.paths.len()) {
        let is_new = |end: &Configuration| {
            let far = |rest: &RemainingPath| (rest.end() - end).norm() >= SEPARATION_RAD;
            remaining.iter().all(far)
        };
        let end = end_at_goal(robot, problem, &previous.paths[index]).filter(is_new);
        if let Some(end) = end {
            remaining.push(RemainingPath {
                path: remaining_path(&previous.paths[index], &problem.start, &end),
                followed: Some(index) == previous.followed,
            });
        }
        if remaining.len() == count {
            break;
        }
    }
    remaining
}

/// The configuration nearest to a path's end that reaches the problem's goal and is clear.
fn end_at_goal(
    robot: &UnitRobot,
    problem: &Problem,
    path: &[Configuration],
) -> Option<Configuration> {
    let old = path.last()?;
    let end = configuration_near(robot, &problem.goal, old);
    end.filter(|end| (end - old).norm() <= SAME_CONFIGURATION_RAD)
        .filter(|end| problem.scene.clearance_at(robot, end) >= 0.0)
}

/// The path from the waypoint nearest to `start`, its two ends moved onto `start` and `end`, what lies between with them.
fn remaining_path(path: &[Configuration], start: &Configuration, end: &Configuration) -> Waypoints {
    let distance = |q: &Configuration| (q - start).norm_squared();
    let order = |a: &usize, b: &usize| distance(&path[*a]).total_cmp(&distance(&path[*b]));
    let nearest = (0..path.len() - 1).min_by(order).unwrap_or(0);
    let mut rest = resample(&path[nearest..]);
    let (first, last) = (start - rest[0], end - rest[rest.len() - 1]);
    for (h, waypoint) in rest.iter_mut().enumerate() {
        let u = parameter(h);
        *waypoint += first * (1.0 - u).powi(2) + last * u.powi(2);
    }
    let final_index = rest.len() - 1;
    (rest[0], rest[final_index]) = (*start, *end);
    rest
}

/// What remains of the path that is followed, as a proposal that is not drawn anew.
pub(super) fn kept_path(remaining: &[RemainingPath]) -> Option<Proposal> {
    let followed = remaining.first().filter(|path| path.followed)?;
    Some(Proposal::of(followed.path.clone(), Source::Kept))
}

/// Puts what remains of the followed motion in the place of the draw to the same goal configuration, unless that draw is so much shorter
/// that it is worth a change.
pub(super) fn keep(kept: Vec<Draw>, draws: &mut [Draw]) {
    for kept in kept.into_iter().filter(|draw| draw.outcome.is_ok()) {
        if !is_worth_a_change(kept.duration_s(), draws[0].duration_s()) {
            draws[0] = kept;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::unit_robot;
    use crate::goals::inverse_kinematics::solve_tip;
    use crate::moving_obstacles::MovingObstacles;
    use crate::path::waypoints::straight_path;
    use crate::problem::Goal;
    use collision::{Ball, Scene};
    use pcc_model::Point;

    fn plan(robot: &UnitRobot) -> (PreviousPlan, Problem) {
        let target = Point::new(1.3, 0.2, 2.2);
        let seeds = [0.9, -0.9].map(|bend| Configuration::from_fn(|i, _| bend * (i as f64).cos()));
        let ends = seeds.map(|seed| solve_tip(robot, &target, &seed).0);
        assert!(
            (ends[0] - ends[1]).norm() > 0.5,
            "two configurations for one tip"
        );
        let start = Configuration::zeros();
        let previous = PreviousPlan {
            paths: ends.iter().map(|end| straight_path(&start, end)).collect(),
            followed: Some(1),
        };
        let problem = Problem {
            start: start.lerp(&ends[1], 0.4).add_scalar(1e-3),
            goal: Goal::Tip(target + Point::new(0.0, 0.05, 0.0)),
            scene: Scene::default(),
            moving: MovingObstacles::default(),
        };
        (previous, problem)
    }

    #[test]
    fn the_followed_path_goes_on_to_a_moved_goal() {
        let robot = unit_robot();
        let (previous, problem) = plan(&robot);
        let remaining = remaining_paths(&previous, &robot, &problem, 10);
        assert_eq!(remaining.len(), 2);
        assert!(remaining[0].followed && !remaining[1].followed);
        for rest in &remaining {
            assert_eq!(rest.path[0], problem.start);
            let miss = (robot.tip(&rest.end()) - problem.goal_tip(&robot)).norm();
            assert!(miss < 1e-7, "{miss}");
        }
        let old = &previous.paths[1];
        let halfway = remaining[0].path[32];
        let away = old
            .iter()
            .map(|q| (q - halfway).norm())
            .fold(f64::INFINITY, f64::min);
        assert!(away < 0.1, "it stays on the old path: {away}");
        assert_eq!(remaining_paths(&previous, &robot, &problem, 1).len(), 1);
    }

    #[test]
    fn a_shape_that_an_obstacle_took_is_given_up() {
        let robot = unit_robot();
        let (previous, mut problem) = plan(&robot);
        let elbow = robot.backbone(&previous.paths[1][63]).point(1, 0.5);
        problem.scene = Scene::new(vec![Ball {
            centre: elbow,
            radius: 0.1,
        }])
        .unwrap();
        let remaining = remaining_paths(&previous, &robot, &problem, 10);
        assert!(remaining.iter().all(|rest| !rest.followed));
    }
}
