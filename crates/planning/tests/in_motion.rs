//! Starts in motion: the state is met exactly, motions begin while the robot brakes, the fastest is told before the others.
#![allow(clippy::unwrap_used)] // tests

mod beside_a_ball;
mod leaving;
mod requests;
mod shipped;

use beside_a_ball::{plan, problem, request};
use collision::{Ball, Scene, certify_trajectory, minimum_clearance};
use leaving::{LARGE, behind_a_ball, leaving, leaving_in, ways};
use pcc_model::{Configuration, Point, SECTIONS};
use planning::{
    Candidate, EarlySelection, Goal, Infeasible, MovingObstacles, PathMetrics, Plan, Planner,
    PlannerError, Problem, Request, Sampler, Selection, Source, StartMotion, Supervision, Told,
    select,
};
use shipped::planner;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use trajectory::{Knot, State, Trajectory, limit_use, stopping_motion};

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
    Knot::of(0.0, state)
}

/// The candidate that takes the shortest time.
fn selected(plan: &Plan) -> &Candidate {
    let start = plan.candidates[0].trajectory.knots()[0].position;
    let selected = select(&plan.candidates, &start, Selection::ShortestTime);
    &plan.candidates[selected.unwrap()]
}

/// The motion that the robots of these tests leave.
fn rest_to_rest(planner: &Planner) -> Trajectory {
    let plan = plan(planner, &problem(), &request());
    Trajectory::clone(&selected(&plan).trajectory)
}

/// A motion is no later than a stop and the fastest motion that the planner finds from there to the same configuration.
fn assert_no_later(planner: &Planner, moving: &Problem, request: &Request, told: &Candidate) {
    let robot = planner.robot();
    let begin = &told.trajectory.knots()[0];
    let stop = stopping_motion(begin, &robot.tendons, &robot.tendon_limits).unwrap();
    let after = Problem {
        start: stop.end(),
        goal: Goal::Configuration(told.end()),
        ..moving.clone()
    };
    let from_rest = Request {
        start_motion: None,
        ..request.clone()
    };
    let go_s = selected(&plan(planner, &after, &from_rest))
        .metrics
        .duration_s;
    let duration_s = told.metrics.duration_s;
    assert!(
        duration_s <= stop.duration() + go_s + 1e-6,
        "{duration_s} s, {} s and {go_s} s",
        stop.duration()
    );
}

/// Motions that begin in exactly this state, within the limits, and certified.
fn assert_begin_at<'a>(
    planner: &Planner,
    scene: &Scene,
    begin: &Knot,
    candidates: impl Iterator<Item = &'a Candidate>,
) {
    let robot = planner.robot();
    for candidate in candidates {
        let motion = &candidate.trajectory;
        assert_eq!(motion.knots()[0], *begin);
        assert!(limit_use(motion, &robot.tendons, &robot.tendon_limits).largest() <= 1.0 + 1e-6);
        assert!(certify_trajectory(robot, scene, motion, 0.0).is_free());
    }
}

/// The one motion that was told: the selected one of ten, which all begin in this state.
fn told_of_ten(
    planner: &Planner,
    scene: &Scene,
    answer: &Plan,
    told: Mutex<Vec<Candidate>>,
    begin: &Knot,
) -> Candidate {
    let mut told = told.into_inner().unwrap();
    assert_eq!(told.len(), 1);
    assert_eq!(told[0].draw, selected(answer).draw);
    assert_eq!(answer.candidates.len(), 10);
    let all = answer.candidates.iter().chain(&told);
    assert_begin_at(planner, scene, begin, all);
    told.remove(0)
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
    let motion = rest_to_rest(&planners[0]);
    for share in [0.1, 0.3, 0.6] {
        let state = motion.at(share * motion.duration());
        for ((moving, in_motion), _) in ways(&planners[0], &state) {
            let in_motion = Request {
                seed: 5,
                ..in_motion
            };
            let untold = plan(&planners[0], &moving, &in_motion);
            for planner in &planners {
                let told = Mutex::new(Vec::new());
                let early_selection = EarlySelection {
                    begin: &|_, _| (),
                    selected: &|candidate| {
                        told.lock().unwrap().push(candidate);
                        Told::InTime
                    },
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
            begin: &|_, can_begin| assert!(can_begin(&knot_at(&then))),
            selected: &|_| Told::InTime,
        };
        let answer = plan_selecting_early(&planner, &moving, &in_motion, early_selection);
        assert_eq!(answer.candidates.len(), 10);
        let all = answer.candidates.iter();
        assert_begin_at(&planner, &moving.scene, &knot_at(&then), all);
        let planned_there = plan(&planner, &later, &from_there);
        let [late, there] = [&answer, &planned_there].map(|it| selected(it).metrics.duration_s);
        assert!(
            (late / there - 1.0).abs() < 0.02,
            "{late} s, {there} s if planned there"
        );
    }
}

#[test]
fn the_later_the_fastest_motion_is_known_the_more_is_to_be_done_for_it() {
    let planner = planner(2);
    let state = rest_to_rest(&planner).at(0.2);
    for ((moving, in_motion), expected) in ways(&planner, &state) {
        let (asked, told) = (Mutex::default(), Mutex::default());
        let early_selection = EarlySelection {
            begin: &|to_be_done, _| Vec::push(&mut asked.lock().unwrap(), to_be_done),
            selected: &|candidate| {
                Vec::push(&mut told.lock().unwrap(), candidate);
                Told::InTime
            },
        };
        plan_selecting_early(&planner, &moving, &in_motion, early_selection);
        assert_eq!(asked.into_inner().unwrap(), expected);
        let told = told.into_inner().unwrap();
        assert_eq!(told.len(), 1);
        assert_no_later(&planner, &moving, &in_motion, &told[0]);
    }
}

#[test]
fn the_fastest_motion_is_joined_again_where_the_switch_was_too_near() {
    let planner = planner(2);
    let motion = rest_to_rest(&planner);
    let state = motion.at(0.2);
    for ((moving, in_motion), expected) in ways(&planner, &state) {
        let then = knot_at(&motion.at(0.204));
        let (asked, told) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
        let early_selection = EarlySelection {
            begin: &|to_be_done, can_begin| {
                if asked.fetch_add(1, Ordering::Relaxed) == 0 {
                    assert_eq!(to_be_done, expected[0]);
                    assert!(can_begin(&then));
                }
            },
            selected: &|candidate| {
                told.lock().unwrap().push(candidate);
                Told::InTime
            },
        };
        let answer = plan_selecting_early(&planner, &moving, &in_motion, early_selection);
        let told = told_of_ten(&planner, &moving.scene, &answer, told, &then);
        assert_no_later(&planner, &moving, &in_motion, &told);
    }
}

#[test]
fn a_motion_that_is_told_too_late_is_joined_again_and_told_once_more() {
    let planner = planner(2);
    let motion = rest_to_rest(&planner);
    let state = motion.at(0.2);
    let then = knot_at(&motion.at(0.204));
    for ((moving, in_motion), _) in ways(&planner, &state) {
        let (is_late, told) = (AtomicBool::new(false), Mutex::new(Vec::new()));
        let early_selection = EarlySelection {
            begin: &|to_be_done, can_begin| {
                let is_late = is_late.load(Ordering::Relaxed);
                assert!(!is_late || to_be_done.is_known() && can_begin(&then));
            },
            selected: &|candidate| {
                if is_late.swap(true, Ordering::Relaxed) {
                    told.lock().unwrap().push(candidate);
                    return Told::InTime;
                }
                assert_eq!(candidate.trajectory.knots()[0], knot_at(&state));
                Told::TooLate
            },
        };
        let answer = plan_selecting_early(&planner, &moving, &in_motion, early_selection);
        let told = told_of_ten(&planner, &moving.scene, &answer, told, &then);
        assert_no_later(&planner, &moving, &in_motion, &told);
    }
}

#[test]
fn a_later_state_that_cannot_brake_leaves_the_plan_where_it_was() {
    let planner = planner(2);
    let state = rest_to_rest(&planner).at(0.2);
    let rushing = Knot {
        velocity: Configuration::repeat(3.0),
        ..knot_at(&state)
    };
    for ((moving, in_motion), expected) in ways(&planner, &state) {
        let asked = Mutex::default();
        let early_selection = EarlySelection {
            begin: &|to_be_done, can_begin| {
                assert!(!can_begin(&rushing));
                Vec::push(&mut asked.lock().unwrap(), to_be_done);
            },
            selected: &|_| Told::InTime,
        };
        let answer = plan_selecting_early(&planner, &moving, &in_motion, early_selection);
        assert_eq!(asked.into_inner().unwrap(), expected);
        assert!(!answer.candidates.is_empty());
        for candidate in &answer.candidates {
            assert_eq!(candidate.trajectory.knots()[0], knot_at(&state));
        }
    }
}

#[test]
fn an_interrupt_before_the_fastest_motion_is_planned_anew_leaves_the_known_one() {
    let planner = planner(1);
    let motion = rest_to_rest(&planner);
    let state = motion.at(0.2);
    let (moving, in_motion) = leaving_in(behind_a_ball(&planner, &state, LARGE), &state);
    for begin in [motion.at(0.2), motion.at(0.204)].map(|state| knot_at(&state)) {
        let is_asked = AtomicBool::new(false);
        let is_interrupted = || is_asked.load(Ordering::Relaxed);
        let told = AtomicUsize::new(0);
        let early_selection = EarlySelection {
            begin: &|_, can_begin| {
                assert!(begin == knot_at(&state) || can_begin(&begin));
                is_asked.store(true, Ordering::Relaxed);
            },
            selected: &|_| {
                told.fetch_add(1, Ordering::Relaxed);
                Told::InTime
            },
        };
        let supervision = Supervision {
            early_selection: Some(early_selection),
            ..Supervision::new(&is_interrupted)
        };
        let plan = planner.plan_supervised(&moving, &in_motion, supervision);
        let answer = plan.unwrap();
        assert!(answer.truncated && told.into_inner() == 1);
        assert_eq!(answer.candidates.len(), 1);
        assert_begin_at(&planner, &moving.scene, &begin, answer.candidates.iter());
    }
}

#[test]
fn an_interrupt_leaves_out_all_but_the_motions_that_may_be_selected() {
    // On one thread the fastest segment is told before paths are drawn.
    let planner = planner(1);
    let (moving, in_motion) = leaving(&rest_to_rest(&planner).at(0.3));
    let is_told = AtomicBool::new(false);
    let is_interrupted = || is_told.load(Ordering::Relaxed);
    let early_selection = EarlySelection {
        begin: &|_, _| (),
        selected: &|_| {
            is_told.store(true, Ordering::Relaxed);
            Told::InTime
        },
    };
    let supervision = Supervision {
        early_selection: Some(early_selection),
        ..Supervision::new(&is_interrupted)
    };
    let plan = planner.plan_supervised(&moving, &in_motion, supervision);
    let answer = plan.unwrap();
    assert!(is_told.into_inner() && answer.truncated);
    assert!((1..10).contains(&answer.candidates.len()));
    for candidate in &answer.candidates {
        assert_eq!(candidate.source, Source::StraightLine);
    }
}

#[test]
fn a_motion_along_the_bending_limit_is_not_left_beyond_it() {
    let planner = planner(2);
    let limit_rad = planner.robot().bending_limit;
    let bent = |turn: f64| {
        let section = [turn.cos(), turn.sin()].map(|part| part * limit_rad);
        Configuration::from_fn(|row, _| section[row % 2])
    };
    let mut joined = 0;
    for turn in [0.3, 0.8, 1.3] {
        let from_rest = Problem {
            start: bent(0.0),
            goal: Goal::Configuration(bent(turn)),
            scene: Scene::default(),
            moving: MovingObstacles::default(),
        };
        let first = plan(&planner, &from_rest, &request());
        let motion = &selected(&first).trajectory;
        for share in [0.2, 0.5, 0.8, 0.95] {
            let state = motion.at(share * motion.duration());
            let other = Problem {
                goal: Goal::Configuration(bent(turn + 0.4)),
                ..from_rest.clone()
            };
            let (moving, in_motion) = leaving_in(other, &state);
            let Ok(plan) = planner.plan(&moving, &in_motion, &|| false) else {
                continue;
            };
            let at_start_rad = largest_bending(&state.position);
            for candidate in &plan.candidates {
                let sampled = candidate.trajectory.sample(5000);
                let largest_rad = sampled.iter().map(largest_bending).fold(0.0, f64::max);
                assert!(largest_rad <= at_start_rad.max(limit_rad) + 1e-8);
                joined += 1;
            }
        }
    }
    assert!(joined > 50, "{joined}");
}

/// The angle by which a configuration bends the section that it bends most, rad.
fn largest_bending(configuration: &Configuration) -> f64 {
    let sections = (0..SECTIONS).map(|i| configuration[2 * i].hypot(configuration[2 * i + 1]));
    sections.fold(0.0, f64::max)
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
fn the_fastest_motion_is_joined_again_where_the_later_switch_was_too_near_as_well() {
    let planner = planner(2);
    let motion = rest_to_rest(&planner);
    let state = motion.at(0.2);
    let planned = ways(&planner, &state).map(|(asked, _)| asked).into_iter();
    for (moving, in_motion) in planned.skip(2) {
        let told_s = [false, true].map(|is_too_near| {
            let told = Mutex::new(Vec::new());
            let later = [motion.at(0.204), motion.at(0.208)].map(|state| knot_at(&state));
            let early_selection = EarlySelection {
                begin: &|to_be_done, can_begin| match to_be_done.is_known() {
                    true if is_too_near => assert!(can_begin(&later[1])),
                    true => {}
                    false => assert!(can_begin(&later[0])),
                },
                selected: &|candidate| {
                    told.lock().unwrap().push(candidate);
                    Told::InTime
                },
            };
            let answer = plan_selecting_early(&planner, &moving, &in_motion, early_selection);
            let begin = &later[usize::from(is_too_near)];
            let told = told_of_ten(&planner, &moving.scene, &answer, told, begin);
            told.metrics.duration_s
        });
        // A path close to an obstacle may have to be begun after the braking, of 0.3 s, once it is moved.
        assert!((told_s[0] - told_s[1]).abs() < 0.3, "{told_s:?}");
    }
}
