//! Planning among solids and in large scenes.
#![allow(clippy::unwrap_used)] // tests

mod requests;
mod shipped;

use collision::{Ball, Scene, Solid, VoxelGrid, certify_trajectory};
use denoiser::FeatureFrame;
use nalgebra::Isometry3;
use pcc_model::{Configuration, Point, Robot, SECTIONS, UnitRobot};
use planning::{
    BALL_FEATURES, Candidate, Goal, Infeasible, MovingObstacles, PlannerError, Problem, Request,
    Sampler, features, residual_coefficients, straight_path,
};
use shipped::planner;
use std::path::Path;
use std::sync::Arc;

const PADDING: [f64; SECTIONS] = [0.0225; SECTIONS];

fn at_root(path: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../..")
        .join(path)
}

fn robot() -> UnitRobot {
    let robot = Robot::from_file(&at_root("config/robots/unit.toml")).unwrap();
    robot.to_unit().unwrap()
}

fn request(sampler: Sampler) -> Request {
    Request {
        candidates: 6,
        padding: PADDING,
        ..requests::request(sampler, 1)
    }
}

fn leaning(angle: f64) -> Configuration {
    Configuration::from_row_slice(&[0.0, angle, 0.0, angle, 0.0, angle])
}

/// From one side to the other.
fn problem(scene: Scene) -> Problem {
    let start = leaning(-0.35);
    let goal = Goal::Tip(robot().tip(&leaning(0.35)));
    Problem {
        start,
        goal,
        scene,
        moving: MovingObstacles::default(),
    }
}

fn box_mesh(sides: &Point, pose: &Isometry3<f64>) -> Solid {
    let file = "v 0 0 0|v 1 0 0|v 0 1 0|v 1 1 0|v 0 0 1|v 1 0 1|v 0 1 1|v 1 1 1";
    let number = |word: &str| word.parse::<f64>().unwrap() - 0.5;
    let vertex = |line: &str| Point::from_iterator(line.split(' ').skip(1).map(number));
    let vertices: Vec<Point> = file.split('|').map(vertex).collect();
    let vertices: Vec<Point> = vertices.iter().map(|v| v.component_mul(sides)).collect();
    let quads = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let triangles = quads.map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).concat();
    Solid::mesh(&vertices, &triangles, pose).unwrap()
}

/// One solid of each kind in the straight segment's way, about where the tip passes.
fn in_the_way() -> [(&'static str, Solid); 4] {
    let (sides, middle) = (
        Point::new(0.3, 0.4, 0.4),
        Isometry3::translation(0.05, 0.0, 3.15),
    );
    let ends = [Point::new(0.0, -0.2, 3.2), Point::new(0.0, 0.2, 3.2)];
    let grid = VoxelGrid {
        counts: [3, 4, 4],
        cell: 0.1,
        filled: vec![true; 48],
    };
    let corner = middle * Isometry3::translation(-0.15, -0.2, -0.2);
    [
        ("capsule", Solid::capsule(ends, 0.15).unwrap()),
        ("box", Solid::cuboid(&sides, &middle).unwrap()),
        ("mesh", box_mesh(&sides, &middle)),
        ("voxels", Solid::voxels(grid, &corner).unwrap()),
    ]
}

/// Clearance over many points of the body and of the motion.
fn sampled(candidate: &Candidate, solid: &Solid, robot: &Robot) -> f64 {
    let motion = &candidate.trajectory;
    let mut least = f64::INFINITY;
    for i in 0..=300 {
        let at = motion.at(motion.duration() * f64::from(i) / 300.0);
        let backbone = robot.backbone(&at.position);
        for place in 0..93 {
            let point = backbone.point((place / 31).min(2), f64::from((place % 31) as u32) / 30.0);
            least = least.min(solid.nearest(&point).distance);
        }
    }
    least - robot.largest_tube_radius()
}

#[test]
fn motions_lead_around_every_kind_of_solid() {
    let (planner, robot) = (planner(2), robot());
    let padded = robot.with_tube_padding(&PADDING);
    for (name, solid) in in_the_way() {
        let solid = Arc::new(solid);
        let scene = Scene::with_solids(Vec::new(), vec![solid.clone()]).unwrap();
        let problem = problem(scene);
        let line = straight_path(&problem.start, &leaning(0.35));
        let clearance = |q: &Configuration| problem.scene.clearance_at(&robot, q);
        let blocked = line.iter().map(clearance).fold(f64::INFINITY, f64::min);
        assert!(
            blocked < -0.05,
            "{name}: the straight path is blocked: {blocked}"
        );
        for sampler in [Sampler::Default, Sampler::Straight, Sampler::RrtConnect] {
            let plan = planner
                .plan(&problem, &request(sampler), &|| false)
                .unwrap();
            let least = if sampler == Sampler::Straight { 1 } else { 5 };
            assert!(plan.candidates.len() >= least, "{name} {sampler:?}");
            for candidate in &plan.candidates {
                let certified =
                    certify_trajectory(&padded, &problem.scene, &candidate.trajectory, 0.0);
                assert!(certified.is_free());
                let sampled = sampled(candidate, &solid, &robot);
                assert!(sampled >= PADDING[0], "{name} {sampler:?}: {sampled}");
                assert!(candidate.metrics.clearance <= sampled);
            }
        }
    }
}

#[test]
fn a_start_inside_a_solid_is_in_collision() {
    let planner = planner(2);
    for (name, solid) in in_the_way() {
        let scene = Scene::with_solids(Vec::new(), vec![Arc::new(solid)]).unwrap();
        let problem = Problem {
            start: leaning(0.0),
            ..problem(scene)
        };
        match planner.plan(&problem, &request(Sampler::Default), &|| false) {
            Err(PlannerError::Infeasible(Infeasible::StartInCollision { clearance })) => {
                assert!(clearance < -0.05, "{name}: {clearance}");
            }
            other => panic!("{name}: {other:?}"),
        }
    }
}

#[test]
fn the_shipped_scene_has_certified_motions() {
    let planner = planner(2);
    let scene = Scene::from_file(&at_root("tests/data/scenes/workshop.toml"), 1.0).unwrap();
    let plan = planner
        .plan(&problem(scene), &request(Sampler::Default), &|| false)
        .unwrap();
    assert!(plan.candidates.len() >= 5, "{}", plan.candidates.len());
}

#[test]
fn the_model_is_told_of_all_balls_of_a_small_scene_and_the_nearest_of_a_large_one() {
    let robot = robot();
    let cloud: Vec<Ball> = (0..1000)
        .map(|i| {
            let turn = f64::from(i) * 2.399_963;
            Ball {
                centre: Point::new(
                    1.6 * turn.cos(),
                    1.6 * turn.sin(),
                    3.0 * f64::from(i) / 1000.0,
                ),
                radius: 0.05,
            }
        })
        .collect();
    let (start, end) = (leaning(-0.35), leaning(0.35));
    let path = straight_path(&start, &end);
    let tip = robot.tip(&end);
    assert!(
        tip.y.abs() < 1e-12 && tip.x > 0.5,
        "the canonical frame is the base frame"
    );
    let told = |balls: &[Ball]| {
        let scene = Scene::new(balls.to_vec()).unwrap();
        residual_coefficients(&robot, &path, &tip, &scene, FeatureFrame::Canonical, false).0
    };
    let few = told(&cloud[..24]);
    let expected = features(&robot, &start, &end, &cloud[..24]);
    assert_eq!((few.ends, few.balls), (expected.ends, expected.balls));
    assert_eq!(told(&cloud).balls.len(), 24 * BALL_FEATURES);
}
