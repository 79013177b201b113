//! Planning again: from a previous plan, from a start in motion, and with candidates before the answer.
#![allow(clippy::unwrap_used)] // tests

mod requests;
mod shipped;

use collision::{Ball, Scene, certify_trajectory, minimum_clearance};
use pcc_model::{Configuration, Point};
use planning::{
    Candidate, EarlySelection, Goal, Infeasible, MovingObstacles, PathMetrics, Plan, Planner,
    PlannerError, PreviousPlan, Problem, Request, Sampler, Selection, Source, StartMotion,
    Supervision, WAYPOINTS, select,
};
use shipped::planner;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use trajectory::{Knot, State, limit_use};

fn request() -> Request {
    requests::request(Sampler::Default, 3)
}

fn problem() -> Problem {
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

fn plan(planner: &Planner, problem: &Problem, request: &Request) -> Plan {
    planner.plan(problem, request, &|| false).unwrap()
}

fn selected_index(plan: &Plan) -> Option<usize> {
    select(&plan.candidates, &problem().start, Selection::ShortestTime)
}

fn plan_selecting_early(
    planner: &Planner,
    problem: &Problem,
    request: &Request,
    early_selection: EarlySelection,
) -> Plan {
    let supervision = Supervision {
        early_selection: Some(early_selection),
        ..Supervision::new(&|| false)
    };
    let plan = planner.plan_supervised(problem, request, supervision);
    plan.unwrap()
}

/// A state as the first knot of a motion.
fn knot_at(state: &State) -> Knot {
    Knot {
        time: 0.0,
        position: state.position,
        velocity: state.velocity,
        acceleration: state.acceleration,
    }
}

fn selected(plan: &Plan) -> &Candidate {
    &plan.candidates[selected_index(plan).unwrap()]
}

fn previous(plan: &Plan) -> Option<Arc<PreviousPlan>> {
    let paths = plan
        .candidates
        .iter()
        .map(|c| c.trajectory.sample(WAYPOINTS));
    Some(Arc::new(PreviousPlan {
        paths: paths.collect(),
        followed: selected_index(plan),
    }))
}

#[test]
fn a_plan_goes_on_in_the_shape_that_is_followed() {
    let planner = planner(2);
    let first = plan(&planner, &problem(), &request());
    let followed = selected(&first);
    let motion = &followed.trajectory;
    let later = Problem {
        start: motion.at(0.4 * motion.duration()).position,
        ..problem()
    };
    let again = Request {
        seed: 77,
        previous: previous(&first),
        ..request()
    };
    let second = plan(&planner, &later, &again);
    let goes_on = selected(&second);
    assert_eq!(goes_on.source, Source::Kept);
    assert!((goes_on.end() - followed.end()).norm() < 1e-6);
    assert_eq!(goes_on.trajectory.knots()[0].position, later.start);
    assert_eq!(second.candidates.len(), 10);
    let afresh = plan(
        &planner,
        &later,
        &Request {
            seed: 77,
            ..request()
        },
    );
    assert!(afresh.candidates.iter().all(|c| c.source != Source::Kept));
    let kept_ends = first.candidates.iter().filter(|old| {
        let near = |new: &&Candidate| (new.end() - old.end()).norm() < 1e-6;
        second.candidates.iter().any(|new| near(&new))
    });
    assert!(
        kept_ends.count() >= 8,
        "the shapes of the plan before are kept"
    );
}

#[test]
fn a_motion_that_an_obstacle_took_is_not_kept() {
    let planner = planner(2);
    let first = plan(&planner, &problem(), &request());
    let end = selected(&first).end();
    let elbow = planner.robot().backbone(&end).point(1, 0.7);
    let in_the_way = Ball {
        centre: elbow,
        radius: 0.1,
    };
    let blocked = Problem {
        scene: Scene::new(vec![in_the_way]).unwrap(),
        ..problem()
    };
    let again = Request {
        previous: previous(&first),
        ..request()
    };
    let second = plan(&planner, &blocked, &again);
    assert!((selected(&second).end() - end).norm() > 0.01);
    for candidate in &second.candidates {
        let motion = &candidate.trajectory;
        assert!(certify_trajectory(planner.robot(), &blocked.scene, motion, 0.0).is_free());
    }
}

/// The request of all tests from a robot in this state.
fn leaving(state: &State) -> (Problem, Request) {
    let problem = Problem {
        start: state.position,
        ..problem()
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

#[test]
fn a_start_in_motion_is_met_exactly_and_left_within_the_limits() {
    let planner = planner(2);
    let robot = planner.robot();
    let first = plan(&planner, &problem(), &request());
    let motion = &selected(&first).trajectory;
    let state = motion.at(0.3 * motion.duration());
    assert!(state.velocity.norm() > 0.1, "it moves");
    let (moving, in_motion) = leaving(&state);
    let answer = plan(&planner, &moving, &in_motion);
    assert_eq!(answer.candidates.len(), 10);
    for candidate in &answer.candidates {
        let motion = &candidate.trajectory;
        let begin = &motion.knots()[0];
        assert_eq!(begin.position, state.position);
        assert_eq!(begin.velocity, state.velocity);
        assert_eq!(begin.acceleration, state.acceleration);
        assert!(motion.knots().len() <= 96);
        assert!(limit_use(motion, &robot.tendons, &robot.tendon_limits).largest() <= 1.0 + 1e-6);
        assert!(certify_trajectory(robot, &moving.scene, motion, 0.0).is_free());
        // Of balls alone, a clearance is within its tolerance.
        let exact = minimum_clearance(robot, &moving.scene, motion, 1e-3);
        let figures = PathMetrics::of(robot, motion, exact);
        let clearance = candidate.metrics.clearance;
        assert!((clearance - figures.clearance).abs() <= 1e-3);
        let same = PathMetrics {
            clearance,
            ..figures
        };
        assert_eq!(candidate.metrics, same, "of the whole motion");
    }
}

#[test]
fn the_fastest_motion_is_told_before_the_others_are_joined_whatever_the_number_of_threads() {
    let planners = [planner(1), planner(2)];
    let first = plan(&planners[0], &problem(), &request());
    for share in [0.1, 0.3, 0.6] {
        let motion = &selected(&first).trajectory;
        let state = motion.at(share * motion.duration());
        let (moving, in_motion) = leaving(&state);
        let in_motion = Request {
            seed: 5,
            ..in_motion
        };
        let untold = plan(&planners[0], &moving, &in_motion);
        for planner in &planners {
            let told = Mutex::new(Vec::new());
            let early_selection = EarlySelection {
                begin: &|| None,
                selected: &|candidate| told.lock().unwrap().push(candidate),
            };
            let answer = plan_selecting_early(planner, &moving, &in_motion, early_selection);
            let told: Vec<Candidate> = told.into_inner().unwrap();
            let [candidate] = told.as_slice() else {
                panic!("told {} times", told.len());
            };
            assert_eq!(candidate.draw, selected(&answer).draw);
            let knots = |it: &Candidate| it.trajectory.knots().to_vec();
            assert!(knots(candidate) == knots(selected(&answer)));
            let of_all = |plan: &Plan| plan.candidates.iter().map(knots).collect::<Vec<_>>();
            assert!(of_all(&answer) == of_all(&untold));
        }
    }
}

#[test]
fn motions_begin_where_the_robot_is_once_paths_are_planned() {
    let planner = planner(2);
    let first = plan(&planner, &problem(), &request());
    let motion = &selected(&first).trajectory;
    for later_s in [0.002, 0.02] {
        // Of the default sampler the fastest motion is known before paths are planned, mostly.
        let fast = |(problem, request): (Problem, Request)| {
            let sampler = Sampler::Fast;
            (problem, Request { sampler, ..request })
        };
        let (moving, in_motion) = fast(leaving(&motion.at(0.3)));
        let then = motion.at(0.3 + later_s);
        let (later, from_there) = fast(leaving(&then));
        let early_selection = EarlySelection {
            begin: &|| Some(knot_at(&then)),
            selected: &|_| (),
        };
        let answer = plan_selecting_early(&planner, &moving, &in_motion, early_selection);
        assert_eq!(answer.candidates.len(), 10);
        let robot = planner.robot();
        for candidate in &answer.candidates {
            let motion = &candidate.trajectory;
            assert_eq!(motion.knots()[0], knot_at(&then));
            assert!(
                limit_use(motion, &robot.tendons, &robot.tendon_limits).largest() <= 1.0 + 1e-6
            );
            assert!(certify_trajectory(robot, &moving.scene, motion, 0.0).is_free());
        }
        let planned_there = plan(&planner, &later, &from_there);
        let [late, there] = [&answer, &planned_there].map(|it| selected(it).metrics.duration_s);
        assert!(
            (late / there - 1.0).abs() < 0.02,
            "{late} s, {there} s if planned there"
        );
    }
}

#[test]
fn an_interrupt_leaves_out_all_but_the_motions_that_may_be_selected() {
    let planner = planner(2);
    let first = plan(&planner, &problem(), &request());
    let state = selected(&first).trajectory.at(0.3);
    let (moving, in_motion) = leaving(&state);
    let is_told = AtomicBool::new(false);
    let is_interrupted = || is_told.load(Ordering::Relaxed);
    let early_selection = EarlySelection {
        begin: &|| None,
        selected: &|_| is_told.store(true, Ordering::Relaxed),
    };
    let supervision = Supervision {
        early_selection: Some(early_selection),
        ..Supervision::new(&is_interrupted)
    };
    let answer = planner
        .plan_supervised(&moving, &in_motion, supervision)
        .unwrap();
    assert!(is_told.into_inner() && !answer.candidates.is_empty());
    let is_whole = answer.candidates.len() == 10;
    assert_eq!(answer.truncated, !is_whole);
}

#[test]
fn a_start_that_cannot_stop_is_refused_by_name() {
    let planner = planner(2);
    let rushing = |speed: f64| Request {
        start_motion: Some(StartMotion {
            velocity: Configuration::repeat(speed),
            acceleration: Configuration::zeros(),
        }),
        ..request()
    };
    let refused = planner
        .plan(&problem(), &rushing(3.0), &|| false)
        .unwrap_err();
    let PlannerError::Infeasible(Infeasible::StartTooFast { share }) = refused else {
        panic!("{refused}");
    };
    assert!(share > 1.0);
    let state = Configuration::from_column_slice(&[0.0, 0.1, 0.0, 0.0, 0.0, 0.0]);
    let touching = planner.robot().tip(&state) + Point::new(0.206, 0.0, 0.0);
    let at_a_wall = Problem {
        start: state,
        scene: Scene::new(vec![Ball {
            centre: touching,
            radius: 0.001,
        }])
        .unwrap(),
        ..problem()
    };
    let towards = Request {
        start_motion: Some(StartMotion {
            velocity: Configuration::from_column_slice(&[0.0, 0.3, 0.0, 0.0, 0.0, 0.0]),
            acceleration: Configuration::zeros(),
        }),
        ..request()
    };
    let refused = planner.plan(&at_a_wall, &towards, &|| false).unwrap_err();
    assert_eq!(
        refused,
        PlannerError::Infeasible(Infeasible::StartCannotStop)
    );
}

#[test]
fn candidates_are_told_as_they_certify() {
    let planner = planner(2);
    let told = Mutex::new(Vec::new());
    let tell = |candidate: Candidate| told.lock().unwrap().push(candidate);
    let supervision = Supervision {
        certified: Some(&tell),
        ..Supervision::new(&|| false)
    };
    let answer = planner
        .plan_supervised(&problem(), &request(), supervision)
        .unwrap();
    let told = told.into_inner().unwrap();
    assert_eq!(told.len(), 10);
    for early in &told {
        let same = |c: &&Candidate| c.draw == early.draw && c.source == early.source;
        if let Some(candidate) = answer.candidates.iter().find(same) {
            assert!(candidate.trajectory.knots() == early.trajectory.knots());
        }
    }
}

#[test]
fn the_fastest_straight_segment_competes() {
    let planner = planner(2);
    for seed in 0..5 {
        let request = |sampler| Request {
            sampler,
            seed,
            ..request()
        };
        let default = plan(&planner, &problem(), &request(Sampler::Default));
        let straight = plan(&planner, &problem(), &request(Sampler::Straight));
        assert!(default.learned_certified > 0);
        for candidate in &default.candidates {
            assert_eq!(candidate.trajectory.knots()[0].position, problem().start);
        }
        let [ours, theirs] = [&default, &straight].map(|p| selected(p).metrics.duration_s);
        assert!(ours <= theirs, "{ours} s against {theirs} s");
    }
}
