//! One motion through several goals.
#![allow(clippy::unwrap_used)] // tests

mod requests;
mod shipped;

use collision::{Ball, Scene, certify_trajectory};
use pcc_model::{Configuration, Point, UnitRobot};
use planning::{
    Candidate, Goal, Infeasible, MovingObstacles, Plan, Planner, PlannerError, Problem, Request,
    Sampler, StartMotion, Supervision, Via, random_configuration,
};
use rand::SeedableRng;
use rand_pcg::Pcg64;
use shipped::planner;
use trajectory::limit_use;

const TIP_TOLERANCE: f64 = 1e-3;

fn request(seed: u64) -> Request {
    Request {
        candidates: 4,
        knots: 256,
        ..requests::request(Sampler::Default, seed)
    }
}

fn via(goal: Goal) -> Via {
    Via {
        goal,
        tip_tolerance: TIP_TOLERANCE,
    }
}

fn route(
    planner: &Planner,
    via: &[Via],
    problem: &Problem,
    request: &Request,
) -> Result<Plan, PlannerError> {
    let supervision = Supervision::new(&|| false);
    planner.plan_route(via, problem, request, supervision)
}

/// A start and the tips of random configurations.
fn tips(robot: &UnitRobot, seed: u64, count: usize) -> (Configuration, Vec<Point>) {
    let mut random = Pcg64::seed_from_u64(seed);
    let start = random_configuration(robot, &mut random);
    let tips = (0..count).map(|_| robot.tip(&random_configuration(robot, &mut random)));
    (start, tips.collect())
}

fn problem(start: Configuration, tip: Point) -> Problem {
    Problem {
        start,
        goal: Goal::Tip(tip),
        scene: Scene::default(),
        moving: MovingObstacles::default(),
    }
}

/// Goals before the last, and the problem, of a route through tips.
fn through(start: Configuration, tips: &[Point]) -> (Vec<Via>, Problem) {
    let (last, before) = tips.split_last().unwrap();
    let before = before.iter().map(|tip| via(Goal::Tip(*tip)));
    (before.collect(), problem(start, *last))
}

/// Distance of the tip from each goal where the motion says that it passes it, with the speed there; the times must increase.
fn passed(robot: &UnitRobot, candidate: &Candidate, via: &[Via]) -> Vec<[f64; 2]> {
    assert_eq!(candidate.passages.len(), via.len());
    let times: Vec<f64> = candidate
        .passages
        .iter()
        .map(|passage| passage.time_s)
        .collect();
    assert!(times.is_sorted(), "{times:?}");
    let both = candidate.passages.iter().zip(via);
    both.map(|(passage, via)| {
        let state = candidate.trajectory.at(passage.time_s);
        let off_rad = (state.position - passage.configuration).norm();
        assert!(off_rad <= 1e-3, "{off_rad}");
        let miss = match via.goal {
            Goal::Tip(tip) => (robot.tip(&state.position) - tip).norm(),
            Goal::Configuration(configuration) => (state.position - configuration).norm(),
        };
        [miss, state.velocity.norm()]
    })
    .collect()
}

#[test]
fn tips_are_passed_exactly_and_without_rest_sooner_than_with_a_stop_at_each() {
    let planner = planner(2);
    let robot = planner.robot();
    let mut shares = Vec::new();
    for seed in 0..8 {
        let (start, tips) = tips(robot, seed, 5);
        let (via, problem) = through(start, &tips);
        let plan = route(&planner, &via, &problem, &request(seed)).unwrap();
        for candidate in &plan.candidates {
            for [miss, speed] in passed(robot, candidate, &via) {
                assert!(miss <= TIP_TOLERANCE, "{miss}");
                assert!(speed > 1e-2, "it rests: {speed}");
            }
            let miss = (robot.tip(&candidate.end()) - tips[4]).norm();
            assert!(miss < 1e-6, "{miss}");
            let most = limit_use(&candidate.trajectory, &robot.tendons, &robot.tendon_limits);
            assert!(most.largest() <= 1.0 + 1e-9, "{most:?}");
            assert!(candidate.trajectory.knots().len() <= 256);
        }
        let fastest_s = fastest_s(&plan);
        shares.push(fastest_s / with_stops_s(&planner, start, &tips, seed));
    }
    shares.sort_by(f64::total_cmp);
    assert!(shares[3] < 0.92, "{shares:?}");
}

fn fastest_s(plan: &Plan) -> f64 {
    let durations = plan.candidates.iter().map(|c| c.metrics.duration_s);
    durations.fold(f64::INFINITY, f64::min)
}

/// Time of the fastest motions to tip after tip, s.
fn with_stops_s(planner: &Planner, mut start: Configuration, tips: &[Point], seed: u64) -> f64 {
    let mut total_s = 0.0;
    for tip in tips {
        let request = requests::request(Sampler::Default, seed);
        let plan = planner
            .plan(&problem(start, *tip), &request, &|| false)
            .unwrap();
        let order =
            |a: &&Candidate, b: &&Candidate| a.metrics.duration_s.total_cmp(&b.metrics.duration_s);
        let fastest = plan.candidates.iter().min_by(order).unwrap();
        total_s += fastest.metrics.duration_s;
        start = fastest.end();
    }
    total_s
}

#[test]
fn a_route_beside_balls_is_certified_whole_and_the_same_with_any_number_of_workers() {
    let balls = [(0.9, 0.9, 1.5), (-1.0, 0.4, 1.8), (0.2, -1.1, 1.6)];
    let balls = balls.map(|(x, y, z)| Ball {
        centre: Point::new(x, y, z),
        radius: 0.35,
    });
    let scene = Scene::new(balls.to_vec()).unwrap();
    let unit = planner(1);
    let robot = unit.robot();
    let mut random = Pcg64::seed_from_u64(2);
    let mut clear = || loop {
        let configuration = random_configuration(robot, &mut random);
        if scene.clearance_at(robot, &configuration) > 0.1 {
            return configuration;
        }
    };
    let start = clear();
    let tips: Vec<Point> = (0..4).map(|_| robot.tip(&clear())).collect();
    let (via, mut problem) = through(start, &tips);
    problem.scene = scene.clone();
    let [one, four] = [1, 4].map(|threads| {
        let planner = planner(threads);
        let plan = route(&planner, &via, &problem, &request(5)).unwrap();
        assert!(!plan.candidates.is_empty());
        for candidate in &plan.candidates {
            let motion = &candidate.trajectory;
            assert!(certify_trajectory(planner.robot(), &problem.scene, motion, 0.0).is_free());
            passed(planner.robot(), candidate, &via);
        }
        let motions = plan
            .candidates
            .into_iter()
            .map(|c| (c.trajectory, c.passages));
        motions.collect::<Vec<_>>()
    });
    assert_eq!(one, four);
}

#[test]
fn a_route_from_motion_begins_in_that_state() {
    let planner = planner(2);
    let robot = planner.robot();
    let (start, tips) = tips(robot, 11, 3);
    let (via, problem) = through(start, &tips);
    let rests = route(&planner, &via, &problem, &request(1)).unwrap();
    let followed = &rests.candidates[0].trajectory;
    let state = followed.at(0.4 * followed.duration());
    let (via, problem) = through(state.position, &tips);
    let moving = Request {
        start_motion: Some(StartMotion {
            velocity: state.velocity,
            acceleration: state.acceleration,
        }),
        ..request(1)
    };
    let plan = route(&planner, &via, &problem, &moving).unwrap();
    assert!(!plan.candidates.is_empty());
    for candidate in &plan.candidates {
        let first = candidate.trajectory.knots()[0];
        assert_eq!(
            [first.position, first.velocity],
            [state.position, state.velocity]
        );
        assert_eq!(first.acceleration, state.acceleration);
        for [miss, _] in passed(robot, candidate, &via) {
            assert!(miss <= TIP_TOLERANCE, "{miss}");
        }
        let most = limit_use(&candidate.trajectory, &robot.tendons, &robot.tendon_limits);
        assert!(most.largest() <= 1.0 + 1e-6, "{most:?}");
    }
}

#[test]
fn configurations_are_passed_also_the_same_one_twice_and_the_start() {
    let planner = planner(2);
    let robot = planner.robot();
    let mut random = Pcg64::seed_from_u64(3);
    let [start, a, b] = [(); 3].map(|()| random_configuration(robot, &mut random) * 0.8);
    let goals = [start, a, a, b, a].map(|q| via(Goal::Configuration(q)));
    let problem = Problem {
        goal: Goal::Configuration(b),
        ..problem(start, Point::zeros())
    };
    let plan = route(&planner, &goals, &problem, &request(1)).unwrap();
    let candidate = &plan.candidates[0];
    for [miss, _] in passed(robot, candidate, &goals) {
        assert!(miss <= 1e-3, "{miss}");
    }
    assert_eq!(candidate.end(), b);
}

#[test]
fn a_request_without_goals_on_the_way_is_an_ordinary_one() {
    let planner = planner(2);
    let (start, tips) = tips(planner.robot(), 7, 1);
    let problem = problem(start, tips[0]);
    let one = route(&planner, &[], &problem, &request(2)).unwrap();
    let other = planner.plan(&problem, &request(2), &|| false).unwrap();
    assert!(
        one.candidates
            .iter()
            .all(|candidate| candidate.passages.is_empty())
    );
    let motions = |plan: &Plan| -> Vec<_> {
        plan.candidates
            .iter()
            .map(|c| c.trajectory.clone())
            .collect()
    };
    assert_eq!(motions(&one), motions(&other));
}

#[test]
fn a_goal_on_the_way_that_cannot_be_reached_is_named() {
    let planner = planner(2);
    let (start, mut tips) = tips(planner.robot(), 7, 3);
    tips[1] = Point::new(0.0, 0.0, 3.5);
    let (via, problem) = through(start, &tips);
    let error = route(&planner, &via, &problem, &request(2)).unwrap_err();
    let PlannerError::InfeasibleVia { index, infeasible } = error else {
        panic!("{error}");
    };
    assert_eq!(index, 1);
    assert!(matches!(infeasible, Infeasible::GoalOutOfReach { .. }));
}
