//! Requests from a robot in motion: to the tip of most tests, or behind a ball.

use super::beside_a_ball::{problem, request};
use collision::{Ball, Scene};
use pcc_model::Configuration;
use planning::{Goal, Planner, Problem, Request, StartMotion, ToBeDone};
use trajectory::State;

/// Radii of balls in the way of a straight segment, which pushing makes hardly longer, or a detour.
pub(crate) const SMALL: f64 = 0.15;
pub(crate) const LARGE: f64 = 0.25;

/// One goal configuration, with a ball of this radius in the way of the straight segment from a state to it.
pub(crate) fn behind_a_ball(planner: &Planner, state: &State, radius: f64) -> Problem {
    let goal = Configuration::from_column_slice(&[-0.6, 0.9, -0.2, 0.5, -0.1, 0.4]);
    let in_the_way = Ball {
        centre: planner.robot().tip(&(0.5 * (state.position + goal))),
        radius,
    };
    Problem {
        goal: Goal::Configuration(goal),
        scene: Scene::new(vec![in_the_way]).unwrap(),
        ..problem()
    }
}

/// The request of most tests from a robot in this state.
pub(crate) fn leaving(state: &State) -> (Problem, Request) {
    leaving_in(problem(), state)
}

/// A request for a problem's goal from a robot in this state.
pub(crate) fn leaving_in(problem: Problem, state: &State) -> (Problem, Request) {
    let problem = Problem {
        start: state.position,
        ..problem
    };
    let request = Request {
        start_motion: Some(StartMotion {
            velocity: state.velocity,
            acceleration: state.acceleration,
        }),
        ..request()
    };
    (problem, request)
}

/// A request whose paths are not pushed out of obstacles.
pub(crate) fn uncorrected((problem, request): (Problem, Request)) -> (Problem, Request) {
    let corrections = 0;
    (
        problem,
        Request {
            corrections,
            ..request
        },
    )
}

/// Requests from a robot in this state, and what is to be done until the fastest motion is known and is told.
pub(crate) fn ways(planner: &Planner, state: &State) -> [((Problem, Request), [ToBeDone; 2]); 4] {
    let behind = |radius| leaving_in(behind_a_ball(planner, state, radius), state);
    [
        (
            leaving(state),
            [ToBeDone::SegmentAgain, ToBeDone::SegmentAgain],
        ),
        (behind(SMALL), [ToBeDone::PathAgain, ToBeDone::PathAgain]),
        (
            behind(LARGE),
            [ToBeDone::PlanningAnew, ToBeDone::PathAgainAndPlanningAnew],
        ),
        (
            uncorrected(behind(SMALL)),
            [
                ToBeDone::JoiningAndPlanningAnew,
                ToBeDone::PathAgainAndPlanningAnew,
            ],
        ),
    ]
}
