//! The end of a motion under way is moved to a target that moves.
#![allow(clippy::unwrap_used)] // tests

mod beside_a_ball;
mod requests;
mod shipped;

use beside_a_ball::{plan, problem, request};
use collision::{Ball, MovingBall, Scene, TimeSpread, certify_trajectory};
use pcc_model::Point;
use planning::{
    EndToMove, Goal, MovingBalls, MovingObstacles, Plan, Planner, Problem, Request, Selection,
    Source, StartMotion, select,
};
use shipped::planner;
use std::sync::Arc;
use trajectory::{MAX_KNOTS, Trajectory, limit_use};

/// What remains of a motion to the tip goal of these tests that leaves some of the limits.
fn remaining(planner: &Planner) -> Trajectory {
    let gentle = Request {
        limits_scale: 0.7,
        ..request()
    };
    let first = plan(planner, &problem(), &gentle);
    let selected = select(&first.candidates, &problem().start, Selection::ShortestTime);
    let motion = &first.candidates[selected.unwrap()].trajectory;
    motion.remaining_from(0.4 * motion.duration()).unwrap()
}

/// A request for a tip goal that has moved by so many section lengths since that motion was planned to it, among no obstacles.
fn following_a_target(planner: &Planner, by: f64) -> (Problem, Request) {
    let remaining = remaining(planner);
    let begin = remaining.knots()[0];
    let target = planner.robot().tip(&remaining.end()) + Point::new(0.6, 0.8, 0.0) * by;
    let problem = Problem {
        start: begin.position,
        goal: Goal::Tip(target),
        scene: Scene::default(),
        moving: MovingObstacles::default(),
    };
    let request = Request {
        start_motion: Some(StartMotion {
            velocity: begin.velocity,
            acceleration: begin.acceleration,
        }),
        end_to_move: Some(EndToMove {
            remaining: Arc::new(remaining),
            most_knots: MAX_KNOTS,
        }),
        ..request()
    };
    (problem, request)
}

/// What remains of the motion that a request follows.
fn followed(request: &Request) -> &Arc<Trajectory> {
    &request.end_to_move.as_ref().unwrap().remaining
}

fn is_moved_end(plan: &Plan) -> bool {
    let sources = plan.candidates.iter().map(|it| it.source);
    sources.eq([Source::MovedEnd])
}

#[test]
fn the_end_is_moved_to_the_target_within_the_limits() {
    let planner = planner(1);
    let (problem, request) = following_a_target(&planner, 0.01);
    let answer = plan(&planner, &problem, &request);
    assert!(is_moved_end(&answer));
    let (motion, followed) = (&answer.candidates[0].trajectory, followed(&request));
    let (robot, limits) = (planner.robot(), &planner.robot().tendon_limits);
    assert_eq!(motion.knots()[0], followed.knots()[0]);
    assert!(limit_use(motion, &robot.tendons, limits).largest() <= 1.0 + 1e-6);
    assert!(certify_trajectory(robot, &problem.scene, motion, 0.0).is_free());
    let Goal::Tip(target) = problem.goal else {
        panic!("a tip");
    };
    assert!((robot.tip(&motion.end()) - target).norm() < 1e-8);
    let [near, far] = [0.01, 0.3].map(|time_s| {
        let [moved, before] = [motion, followed].map(|it| it.at(time_s).position);
        (moved - before).norm()
    });
    assert!(near < 1e-6 && far > 1e-3, "{near} {far}");
}

#[test]
fn an_end_that_cannot_be_moved_is_planned_anew() {
    let planner = planner(1);
    let (problem, request) = following_a_target(&planner, 0.01);
    let followed = followed(&request);
    let half_way = followed.at(0.5 * followed.duration()).position;
    let in_the_way = Ball {
        centre: planner.robot().tip(&half_way),
        radius: 0.1,
    };
    let blocked = Problem {
        scene: Scene::new(vec![in_the_way]).unwrap(),
        ..problem.clone()
    };
    let gentle = Request {
        limits_scale: 0.3,
        ..request.clone()
    };
    let full = Request {
        end_to_move: Some(EndToMove {
            remaining: Arc::clone(followed),
            most_knots: followed.knots().len() + 3,
        }),
        ..request.clone()
    };
    for (problem, request) in [
        following_a_target(&planner, 0.3),
        following_a_target(&planner, 0.0),
        (blocked, request.clone()),
        (problem.clone(), gentle),
        (problem, full),
    ] {
        let answer = plan(&planner, &problem, &request);
        assert!(!answer.candidates.is_empty());
        let anew = Request {
            end_to_move: None,
            ..request
        };
        let expected = plan(&planner, &problem, &anew);
        let durations = |plan: &Plan| -> Vec<f64> {
            let all = plan.candidates.iter();
            all.map(|it| it.metrics.duration_s).collect()
        };
        assert_eq!(durations(&answer), durations(&expected));
    }
}

#[test]
fn an_end_is_moved_only_where_no_moving_ball_comes() {
    let planner = planner(1);
    let (problem, request) = following_a_target(&planner, 0.01);
    let followed = followed(&request);
    let met_s = 0.5 * followed.duration();
    let tip = planner.robot().tip(&followed.at(met_s).position);
    let velocity = Point::new(0.0, 0.0, -0.5);
    for (late_s, is_moved) in [(0.0, false), (60.0, true)] {
        let ball = Ball {
            centre: tip - velocity * (met_s + late_s),
            radius: 0.1,
        };
        let source = MovingBalls {
            balls: vec![MovingBall { ball, velocity }],
            spread: TimeSpread {
                earliest: -0.1,
                latest: 0.1,
                seen: f64::NEG_INFINITY,
            },
        };
        let among = Problem {
            moving: MovingObstacles {
                sources: vec![source],
                braking: None,
            },
            ..problem.clone()
        };
        assert_eq!(is_moved_end(&plan(&planner, &among, &request)), is_moved);
    }
}
