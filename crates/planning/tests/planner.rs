//! The planner as its users see it: determinism, infeasible problems by name, certified answers.
#![allow(clippy::unwrap_used)] // tests

mod requests;

use collision::{Ball, Scene};
use datasets::scenes::{Setting, Target, draw_target, reference_layout};
use denoiser::{Manifest, Precision, Solver, TemporalUnet};
use pcc_model::{Configuration, Point, Robot, UnitRobot};
use planning::{
    Candidate, DiffusionModel, DiffusionSettings, Failure, Goal, Guidance, Infeasible, Models,
    MovingObstacles, Plan, Planner, PlannerError, Problem, Request, Sampler, Stage,
};
use requests::request;
use std::path::Path;

fn robot() -> UnitRobot {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../config/robots/unit.toml");
    let robot = Robot::from_file(Path::new(file)).unwrap();
    robot.to_unit().unwrap()
}

#[test]
fn a_planner_keeps_the_length_of_the_sections_of_its_robots_file() {
    let file = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../config/robots/authors-42mm.toml"
    );
    let robot = Robot::from_file(Path::new(file)).unwrap();
    let planner = Planner::new(robot.to_unit().unwrap(), Models::default(), 1).unwrap();
    let kept = planner.robot().section_length_m();
    assert_eq!(kept.to_bits(), robot.section_lengths[0].to_bits());
}

fn plan(planner: &Planner, problem: &Problem, request: &Request) -> Result<Plan, PlannerError> {
    planner.plan(problem, request, &|| false)
}

fn from_straight(goal: Goal, balls: Vec<Ball>) -> Problem {
    Problem {
        start: Configuration::zeros(),
        goal,
        scene: Scene::new(balls).unwrap(),
        moving: MovingObstacles::default(),
    }
}

/// The small diffusion model of the parity test.
fn diffusion() -> Models {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixtures");
    let manifest = Manifest::open(Path::new(folder)).unwrap();
    let file = manifest.weights("sampled").unwrap();
    let unet = TemporalUnet::load(&file, robot().bending_limit).unwrap();
    let settings = DiffusionSettings {
        solver: Solver::Ddim,
        steps: 2,
        precision: Precision::F32,
    };
    Models {
        diffusion: Some(DiffusionModel::new(unet, settings).unwrap()),
        ..Models::default()
    }
}

const POST: Sampler = Sampler::DiffusionPost;
/// Those that need no model.
const CLASSICAL: [Sampler; 4] = [
    Sampler::Straight,
    Sampler::StraightDrawn,
    Sampler::RrtConnect,
    Sampler::RrtSmooth,
];

/// The first problems of a setting, from starts that are bent: the tip of a straight robot can set out sideways only.
fn problems(robot: &UnitRobot, setting: Setting, count: usize) -> Vec<Problem> {
    let targets = (0..).filter_map(|index| draw_target(robot, setting, 5, index));
    let problem = |target: Target| Problem {
        start: target.starts[target.starts.len() - 1],
        goal: Goal::Tip(target.tip),
        scene: target.scene,
        moving: MovingObstacles::default(),
    };
    targets.map(problem).take(count).collect()
}

#[test]
fn infeasible_problems_are_named() {
    let planner = Planner::new(robot(), diffusion(), 1).unwrap();
    let tip = Goal::Tip(Point::new(1.5, 0.0, 2.4));
    let on_the_axis = from_straight(tip, reference_layout(1));
    let bent = Problem {
        start: Configuration::repeat(1.3),
        ..from_straight(tip, vec![])
    };
    let far = from_straight(Goal::Tip(Point::new(3.0, 0.0, 2.0)), vec![]);
    let too_bent = from_straight(Goal::Configuration(Configuration::repeat(1.3)), vec![]);
    let ball = Ball {
        centre: Point::new(1.5, 0.0, 2.4),
        radius: 0.3,
    };
    let on_the_goal = from_straight(tip, vec![ball]);
    for sampler in [Sampler::Straight, POST] {
        let ask = |problem: &Problem| match plan(&planner, problem, &request(sampler, 1)) {
            Err(PlannerError::Infeasible(reason)) => reason,
            other => panic!("{other:?}"),
        };
        let start = ask(&on_the_axis);
        assert!(
            matches!(start, Infeasible::StartInCollision { clearance } if clearance < -0.5),
            "{start}"
        );
        let start = ask(&bent);
        assert!(
            matches!(start, Infeasible::StartOutOfLimits { excess_rad, .. } if excess_rad > 0.2),
            "{start}"
        );
        for problem in [&far, &too_bent] {
            let goal = ask(problem);
            assert!(
                matches!(goal, Infeasible::GoalOutOfReach { miss } if miss > 0.1),
                "{goal}"
            );
        }
        let goal = ask(&on_the_goal);
        assert!(
            matches!(goal, Infeasible::GoalInCollision { configurations, .. } if configurations > 10),
            "{goal}"
        );
    }
    for problem in [far, too_bent, on_the_goal] {
        let traced = planner.trace(&problem, Guidance::Post, 1);
        assert!(
            matches!(traced, Err(PlannerError::Infeasible(_))),
            "{problem:?}"
        );
    }
}

#[test]
fn diffusion_books_every_stage_and_attaches_nothing_once_it_is_interrupted() {
    let planner = Planner::new(robot(), diffusion(), 2).unwrap();
    let problem = from_straight(Goal::Tip(Point::new(1.5, 0.0, 2.4)), vec![]);
    let whole = plan(&planner, &problem, &request(POST, 1)).unwrap();
    let stages = whole.stages;
    assert!(
        [Stage::Condition, Stage::Sample, Stage::Correct]
            .iter()
            .all(|stage| stages[*stage] > 0.0),
        "{stages:?}"
    );
    assert!(!whole.truncated && whole.draws.len() == 10);
    // Each of the two workers asks before every evaluation and with the result: then the ends are due.
    let asked = std::sync::atomic::AtomicUsize::new(0);
    let interrupt = || asked.fetch_add(1, std::sync::atomic::Ordering::Relaxed) >= 6;
    let cut = planner
        .plan(&problem, &request(POST, 1), &interrupt)
        .unwrap();
    assert!(cut.truncated && cut.candidates.is_empty());
    for (draw, of_the_whole) in cut.draws.iter().zip(&whole.draws) {
        assert_eq!(draw.outcome.as_ref().err(), Some(&Failure::Truncated));
        assert_eq!(draw.sampled, of_the_whole.sampled);
    }
}

#[test]
fn the_learned_samplers_need_a_model() {
    let planner = Planner::new(robot(), Models::default(), 1).unwrap();
    let problem = from_straight(Goal::Tip(Point::new(1.5, 0.0, 2.4)), vec![]);
    for sampler in [Sampler::Default, Sampler::Fast] {
        assert_eq!(
            plan(&planner, &problem, &request(sampler, 1)).unwrap_err(),
            PlannerError::ModelNotLoaded("fast")
        );
    }
}

#[test]
fn the_same_seed_gives_the_same_bits_with_one_thread_and_with_two() {
    let planners = [1, 2].map(|threads| Planner::new(robot(), Models::default(), threads).unwrap());
    let target = (0..)
        .find_map(|i| draw_target(planners[0].robot(), Setting::General(Some(6)), 3, i))
        .unwrap();
    let problem = Problem {
        start: target.starts[0],
        goal: Goal::Tip(target.tip),
        scene: target.scene,
        moving: MovingObstacles::default(),
    };
    for sampler in CLASSICAL {
        let [one, two] = planners
            .each_ref()
            .map(|p| plan(p, &problem, &request(sampler, 7)).unwrap());
        assert!(!one.candidates.is_empty());
        assert_eq!(one.candidates.len(), two.candidates.len());
        for (a, b) in one.candidates.iter().zip(&two.candidates) {
            assert!(a.trajectory.knots() == b.trajectory.knots());
        }
        let other = plan(&planners[0], &problem, &request(sampler, 8)).unwrap();
        let ends = |p: &Plan| p.candidates.iter().map(Candidate::end).collect::<Vec<_>>();
        assert!(
            ends(&one) != ends(&other),
            "another seed draws other goal configurations"
        );
    }
}

#[test]
fn straight_drawn_gives_the_same_segments_smoother_tips() {
    let planner = Planner::new(robot(), Models::default(), 2).unwrap();
    let (mut both, mut smoother) = (0, 0);
    for problem in problems(planner.robot(), Setting::General(None), 20) {
        let of = |sampler| plan(&planner, &problem, &request(sampler, 1)).unwrap();
        let (straight, drawn) = (of(Sampler::Straight), of(Sampler::StraightDrawn));
        assert_eq!(straight.draws.len(), drawn.draws.len());
        for (plain, drawn) in straight.draws.iter().zip(&drawn.draws) {
            assert_eq!(plain.sampled, drawn.sampled);
            assert_eq!(plain.source, drawn.source);
            assert_ne!(drawn.path, drawn.sampled, "its tip is drawn onto a curve");
            if let (Ok(plain), Ok(drawn)) = (&plain.outcome, &drawn.outcome) {
                assert!((plain.trajectory.end() - drawn.trajectory.end()).norm() < 1e-9);
                both += 1;
                let smoothness = [plain, drawn].map(|motion| motion.metrics.tip_smoothness);
                smoother += usize::from(smoothness[1] < smoothness[0]);
            }
        }
    }
    assert!(
        both > 100 && 5 * smoother > 4 * both,
        "{smoother} of {both}"
    );
}

#[test]
fn rrt_smooth_certifies_what_rrt_connect_does_and_is_mostly_smoother() {
    let planner = Planner::new(robot(), Models::default(), 2).unwrap();
    let (mut both, mut smoother) = (0, 0);
    for problem in problems(planner.robot(), Setting::Hard, 6) {
        let of = |sampler| plan(&planner, &problem, &request(sampler, 1)).unwrap();
        let (tree, smooth) = (of(Sampler::RrtConnect), of(Sampler::RrtSmooth));
        for (tree, smooth) in tree.draws.iter().zip(&smooth.draws) {
            assert_eq!(tree.outcome.is_ok(), smooth.outcome.is_ok());
            if let (Ok(tree), Ok(smooth)) = (&tree.outcome, &smooth.outcome) {
                assert!((tree.trajectory.end() - smooth.trajectory.end()).norm() < 1e-9);
                both += 1;
                let smoothness = [tree, smooth].map(|motion| motion.metrics.tip_smoothness);
                smoother += usize::from(smoothness[1] < smoothness[0]);
            }
        }
    }
    assert!(both > 40 && 2 * smoother > both, "{smoother} of {both}");
}

#[test]
fn an_interrupt_truncates_and_nothing_uncertified_is_delivered() {
    let planner = Planner::new(robot(), Models::default(), 2).unwrap();
    let problem = from_straight(Goal::Tip(Point::new(1.5, 0.0, 2.4)), vec![]);
    for sampler in CLASSICAL {
        let answer = planner.plan(&problem, &request(sampler, 1), &|| true);
        let answer = answer.unwrap();
        assert!(answer.truncated && answer.candidates.is_empty());
    }
}

#[test]
fn a_tree_that_is_interrupted_while_it_grows_says_so() {
    let planner = Planner::new(robot(), Models::default(), 1).unwrap();
    // A cage around the straight robot: its goal is clear, no way leads out.
    let cage = (0..3).flat_map(|ring| {
        (0..12).map(move |i| {
            let angle = f64::from(i) * std::f64::consts::TAU / 12.0;
            let height = 1.3 + 0.7 * f64::from(ring);
            Ball {
                centre: Point::new(0.65 * angle.cos(), 0.65 * angle.sin(), height),
                radius: 0.35,
            }
        })
    });
    let out = Configuration::from_column_slice(&[0.0, 1.5, 0.0, 1.5, 0.0, 0.0]);
    let problem = from_straight(Goal::Configuration(out), cage.collect());
    let asked = std::sync::atomic::AtomicUsize::new(0);
    let interrupt = || asked.fetch_add(1, std::sync::atomic::Ordering::Relaxed) >= 20;
    let one = Request {
        candidates: 1,
        ..request(Sampler::RrtConnect, 1)
    };
    let answer = planner.plan(&problem, &one, &interrupt).unwrap();
    assert!(answer.truncated && answer.candidates.is_empty());
    let whole = plan(&planner, &problem, &one).unwrap();
    assert!(
        !whole.truncated && whole.candidates.is_empty(),
        "there is no way out"
    );
}

#[test]
fn a_start_a_little_beyond_the_bending_limit_is_left_from_exactly_there() {
    let planner = Planner::new(robot(), Models::default(), 1).unwrap();
    let mut problem = from_straight(Goal::Tip(Point::new(1.5, 0.0, 2.4)), vec![]);
    problem.start[2] = planner.robot().bending_limit + 4e-3;
    for sampler in CLASSICAL {
        let answer = plan(&planner, &problem, &request(sampler, 1)).unwrap();
        assert!(!answer.candidates.is_empty());
        for candidate in &answer.candidates {
            let start = candidate.trajectory.knots()[0].position;
            assert_eq!(start, problem.start);
        }
    }
}

#[test]
fn start_and_goal_may_be_the_same_and_scenes_of_any_size_are_answered() {
    let planner = Planner::new(robot(), Models::default(), 2).unwrap();
    let here = Configuration::from_column_slice(&[0.2, 0.1, -0.3, 0.4, 0.0, 0.5]);
    let at_most = Request {
        candidates: 64,
        ..request(Sampler::Straight, 1)
    };
    let far_points = (0..64).map(|i| Ball {
        centre: Point::new(3.0 + f64::from(i), 0.0, 1.0),
        radius: 0.0,
    });
    for goal in [
        Goal::Configuration(here),
        Goal::Tip(planner.robot().tip(&here)),
    ] {
        let problem = Problem {
            start: here,
            goal,
            scene: Scene::new(far_points.clone().collect()).unwrap(),
            moving: MovingObstacles::default(),
        };
        for sampler in CLASSICAL {
            let answer = plan(
                &planner,
                &problem,
                &Request {
                    sampler,
                    ..at_most.clone()
                },
            )
            .unwrap();
            assert!(!answer.candidates.is_empty());
            let metrics = answer.candidates.iter().map(|c| c.metrics);
            assert!(
                metrics
                    .map(|m| m.duration_s + m.clearance)
                    .all(f64::is_finite)
            );
        }
    }
}

#[test]
fn a_homing_request_ends_in_its_configuration() {
    let planner = Planner::new(robot(), Models::default(), 1).unwrap();
    let home = Configuration::from_column_slice(&[0.2, 0.1, -0.3, 0.4, 0.0, 0.5]);
    let answer = plan(
        &planner,
        &from_straight(Goal::Configuration(home), vec![]),
        &request(Sampler::Straight, 1),
    )
    .unwrap();
    assert_eq!(answer.candidates.len(), 1);
    assert!((answer.candidates[0].end() - home).norm() < 1e-12);
}
