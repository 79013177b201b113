//! The problem and the request from which tests of planning again, and in motion, begin.

use super::requests;
use collision::{Ball, Scene};
use pcc_model::{Configuration, Point};
use planning::{Goal, MovingObstacles, Plan, Planner, Problem, Request, Sampler};

/// The plain request of these tests.
pub(crate) fn request() -> Request {
    requests::request(Sampler::Default, 3)
}

/// A tip to be reached, beside a ball.
pub(crate) fn problem() -> Problem {
    let ball = Ball {
        centre: Point::new(0.9, 0.9, 1.5),
        radius: 0.3,
    };
    Problem {
        start: Configuration::from_column_slice(&[0.3, -0.5, 0.2, -0.4, 0.1, -0.3]),
        goal: Goal::Tip(Point::new(1.5, 0.0, 2.4)),
        scene: Scene::new(vec![ball]).unwrap(),
        moving: MovingObstacles::default(),
    }
}

/// The plan of a request that nobody interrupts.
pub(crate) fn plan(planner: &Planner, problem: &Problem, request: &Request) -> Plan {
    planner.plan(problem, request, &|| false).unwrap()
}
