//! Planning among balls that move while the robot does, judged by dense sampling of where they can be.
#![allow(clippy::unwrap_used)] // tests

mod requests;
mod shipped;

use collision::{Ball, MovingBall, Scene, TimeSpread};
use pcc_model::{Configuration, Point, UnitRobot};
use planning::{
    Failure, Goal, Infeasible, MovingBalls, MovingObstacles, Plan, Planner, PlannerError, Problem,
    Sampler, StartMotion, Supervision, Via,
};
use shipped::planner;
use trajectory::{BRAKING_SHARE, RateLaw, Trajectory};

const SPREAD: TimeSpread = TimeSpread {
    earliest: -0.5,
    latest: 0.6,
    seen: f64::NEG_INFINITY,
};

/// A quarter turn of the whole robot, with a ball in the middle of the tip's straight way at `met_s`.
fn problem(robot: &UnitRobot, met_s: f64) -> Problem {
    let start = Configuration::from_column_slice(&[0.0, 0.6, 0.0, 0.6, 0.0, 0.6]);
    let velocity = Point::new(0.7, 0.0, 0.2);
    let ball = Ball {
        centre: robot.tip(&Configuration::zeros()) - velocity * met_s,
        radius: 0.15,
    };
    let limits = &robot.tendon_limits;
    Problem {
        start,
        goal: Goal::Configuration(-start),
        scene: Scene::default(),
        moving: MovingObstacles {
            sources: vec![MovingBalls {
                balls: vec![MovingBall { ball, velocity }],
                spread: SPREAD,
            }],
            braking: Some(RateLaw::new(
                &robot.tendons,
                limits.acceleration * BRAKING_SHARE,
            )),
        },
    }
}

fn plan(planner: &Planner, problem: &Problem, sampler: Sampler) -> Plan {
    let request = requests::request(sampler, 3);
    planner.plan(problem, &request, &|| false).unwrap()
}

/// The smallest clearance from everywhere that the ball can be while the motion is at each place, by dense sampling.
fn clearance(robot: &UnitRobot, moving: &MovingObstacles, motion: &Trajectory) -> f64 {
    let stop_s = moving
        .braking
        .as_ref()
        .unwrap()
        .longest_stop(motion.knots());
    let source = &moving.sources[0];
    let (earliest, latest) = (
        source.spread.earliest - stop_s,
        source.spread.latest + stop_s,
    );
    let at = |time: f64| {
        let backbone = robot.backbone(&motion.at(time).position);
        let places = (0..=60).map(|i| earliest + (latest - earliest) * f64::from(i) / 60.0);
        let balls = places.map(|offset| source.balls[0].at(time + offset));
        let scene = Scene::new(balls.collect()).unwrap();
        scene.clearance(&backbone, &robot.tube_radii)
    };
    let times = (0..=300).map(|i| motion.duration() * f64::from(i) / 300.0);
    times.map(at).fold(f64::INFINITY, f64::min)
}

#[test]
fn motions_keep_clear_of_everywhere_that_a_ball_can_be() {
    let planner = planner(2);
    let robot = planner.robot();
    // The ball comes when a motion that does not mind it would be half-way.
    let still = Problem {
        moving: MovingObstacles::default(),
        ..problem(robot, 0.0)
    };
    let straight = plan(&planner, &still, Sampler::Straight);
    let straight = &straight.candidates[0].trajectory;
    let crossing = problem(robot, 0.5 * straight.duration());
    let through = clearance(robot, &crossing.moving, straight);
    assert!(through < -0.1, "the straight motion meets it: {through}");
    for sampler in [
        Sampler::Straight,
        Sampler::Default,
        Sampler::Fast,
        Sampler::RrtConnect,
        Sampler::RrtSmooth,
    ] {
        let plan = plan(&planner, &crossing, sampler);
        assert!(!plan.candidates.is_empty(), "{sampler:?}");
        for candidate in &plan.candidates {
            let motion = &candidate.trajectory;
            let clear = clearance(robot, &crossing.moving, motion);
            assert!(clear > 0.0, "{sampler:?}: {clear}");
            let told = candidate.metrics.clearance;
            assert!(told <= clear + 1e-9, "{sampler:?}: {told} of {clear}");
            assert!(motion.knots().len() <= 96);
            assert_eq!(motion.knots()[0].position, crossing.start);
            assert!((motion.end() + crossing.start).norm() < 1e-9);
        }
    }
}

#[test]
fn a_motion_that_begins_in_motion_keeps_clear_too() {
    let planner = planner(2);
    let robot = planner.robot();
    let still = Problem {
        moving: MovingObstacles::default(),
        ..problem(robot, 0.0)
    };
    let first = plan(&planner, &still, Sampler::Straight);
    let first = &first.candidates[0].trajectory;
    let left_s = 0.15 * first.duration();
    let state = first.at(left_s);
    let crossing = Problem {
        start: state.position,
        ..problem(robot, 0.5 * first.duration() - left_s)
    };
    let request = planning::Request {
        start_motion: Some(StartMotion {
            velocity: state.velocity,
            acceleration: state.acceleration,
        }),
        ..requests::request(Sampler::Default, 3)
    };
    let unaware = planner.plan(
        &Problem {
            moving: MovingObstacles::default(),
            ..crossing.clone()
        },
        &request,
        &|| false,
    );
    let meets = unaware
        .unwrap()
        .candidates
        .iter()
        .any(|candidate| clearance(robot, &crossing.moving, &candidate.trajectory) < 0.0);
    assert!(meets, "a motion that does not mind the ball meets it");
    let plan = planner.plan(&crossing, &request, &|| false).unwrap();
    assert!(!plan.candidates.is_empty());
    for candidate in &plan.candidates {
        let clear = clearance(robot, &crossing.moving, &candidate.trajectory);
        assert!(clear > 0.0, "{clear}");
        assert_eq!(candidate.trajectory.knots()[0].velocity, state.velocity);
    }
}

#[test]
fn a_start_in_a_moving_ball_is_named() {
    let planner = planner(1);
    let robot = planner.robot();
    let mut inside = problem(robot, 0.0);
    let moving = &mut inside.moving.sources[0].balls[0];
    moving.ball.centre = robot.tip(&inside.start);
    let request = requests::request(Sampler::Default, 3);
    match planner.plan(&inside, &request, &|| false) {
        Err(PlannerError::Infeasible(Infeasible::StartInCollision { clearance })) => {
            assert!(clearance < -0.1, "{clearance}");
        }
        other => panic!("{other:?}"),
    }
}

/// Times after its end at which a robot that stands there is looked at, s.
fn afterwards() -> impl Iterator<Item = f64> {
    (0..=6_000).map(|step| f64::from(step) * 0.01)
}

/// The smallest clearance of a robot that stands at the end of a motion, from everywhere that the ball can be within a minute.
fn clearance_at_the_end(robot: &UnitRobot, moving: &MovingObstacles, motion: &Trajectory) -> f64 {
    let braking = moving.braking.as_ref().unwrap();
    let stop_s = braking.longest_stop(motion.knots());
    let source = &moving.sources[0];
    let earliest_s = motion.duration() + source.spread.earliest - stop_s;
    let clearances = afterwards().map(|after_s| {
        let ball = source.balls[0].at(earliest_s + after_s);
        let scene = Scene::new(vec![ball]).unwrap();
        scene.clearance_at(robot, &motion.end())
    });
    clearances.fold(f64::INFINITY, f64::min)
}

/// The quarter turn, with a ball that comes to where it ends at `met_s`.
fn comes_to_the_end(robot: &UnitRobot, met_s: f64) -> Problem {
    let mut problem = problem(robot, 0.0);
    let end = -problem.start;
    let moving = &mut problem.moving.sources[0].balls[0];
    moving.velocity = Point::new(0.0, 0.7, 0.0);
    moving.ball.centre = robot.tip(&end) - moving.velocity * met_s;
    problem
}

#[test]
fn a_motion_ends_where_no_ball_will_come() {
    let planner = planner(2);
    let robot = planner.robot();
    for sampler in [Sampler::Straight, Sampler::Default, Sampler::RrtSmooth] {
        let still = Problem {
            moving: MovingObstacles::default(),
            ..problem(robot, 0.0)
        };
        let unaware = plan(&planner, &still, sampler);
        let unaware = &unaware.candidates[0].trajectory;
        let crossing = comes_to_the_end(robot, unaware.duration() + 3.0);
        let on_the_way = clearance(robot, &crossing.moving, unaware);
        let standing = clearance_at_the_end(robot, &crossing.moving, unaware);
        assert!(
            on_the_way > 0.0 && standing < -0.1,
            "{on_the_way} {standing}"
        );
        let plan = plan(&planner, &crossing, sampler);
        assert!(!plan.candidates.is_empty(), "{sampler:?}");
        for candidate in &plan.candidates {
            let motion = &candidate.trajectory;
            let clear = clearance(robot, &crossing.moving, motion);
            let standing = clearance_at_the_end(robot, &crossing.moving, motion);
            assert!(
                clear > 0.0 && standing > 0.0,
                "{sampler:?}: {clear} {standing}"
            );
        }
    }
}

#[test]
fn an_end_to_which_a_ball_comes_after_the_longest_wait_has_no_motion() {
    let planner = planner(2);
    let robot = planner.robot();
    let later = plan(&planner, &comes_to_the_end(robot, 20.0), Sampler::Default);
    assert!(later.candidates.is_empty());
    let failures = later.draws.iter().map(|draw| draw.outcome.as_ref().err());
    for failure in failures {
        assert_eq!(failure, Some(&Failure::Collision));
    }
    let long_after = plan(&planner, &comes_to_the_end(robot, 90.0), Sampler::Default);
    assert!(!long_after.candidates.is_empty());
}

#[test]
fn a_route_keeps_clear_of_a_ball_when_it_passes_it() {
    let planner = planner(2);
    let robot = planner.robot();
    let bent = Configuration::from_column_slice(&[0.3, 0.3, 0.3, 0.3, 0.3, 0.3]);
    let via = [Via {
        goal: Goal::Configuration(bent),
        tip_tolerance: 1e-3,
    }];
    let route = |problem: &Problem| {
        let request = requests::request(Sampler::Default, 3);
        let supervision = Supervision::new(&|| false);
        planner
            .plan_route(&via, problem, &request, supervision)
            .unwrap()
    };
    let still = Problem {
        moving: MovingObstacles::default(),
        ..problem(robot, 0.0)
    };
    let unaware = route(&still);
    let [passage] = unaware.candidates[0].passages[..] else {
        panic!("one via is passed")
    };
    let unaware = &unaware.candidates[0].trajectory;
    let second_leg_s = 0.5 * (passage.time_s + unaware.duration());
    let mut crossing = problem(robot, 0.0);
    let moving = &mut crossing.moving.sources[0].balls[0];
    let met = robot.tip(&unaware.at(second_leg_s).position);
    moving.ball.centre = met - moving.velocity * second_leg_s;
    let through = clearance(robot, &crossing.moving, unaware);
    assert!(through < -0.1, "the unaware one meets it: {through}");
    let plan = route(&crossing);
    assert!(!plan.candidates.is_empty());
    for candidate in &plan.candidates {
        let clear = clearance(robot, &crossing.moving, &candidate.trajectory);
        let standing = clearance_at_the_end(robot, &crossing.moving, &candidate.trajectory);
        assert!(clear > 0.0 && standing > 0.0, "{clear} {standing}");
        let [passage] = candidate.passages[..] else {
            panic!("one via is passed")
        };
        let miss_rad = (candidate.trajectory.at(passage.time_s).position - bent).norm();
        assert!(miss_rad < 1e-3, "{miss_rad}");
    }
}
