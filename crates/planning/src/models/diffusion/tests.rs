use super::*;
use crate::fixtures::unit_robot;
use crate::moving_obstacles::MovingObstacles;
use crate::problem::Goal;
use collision::Ball;
use denoiser::Manifest;
use safetensors::SafeTensors;
use std::path::Path;

/// What `scripts/fixtures_sampling.py` wrote.
struct Fixture(Vec<u8>);

impl Fixture {
    fn read() -> Self {
        let file = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/tests/fixtures/sampling.safetensors"
        );
        Self(std::fs::read(file).unwrap())
    }

    fn values(&self, name: &str) -> Vec<f32> {
        let file = SafeTensors::deserialize(&self.0).unwrap();
        let bytes = file.tensor(name).unwrap().data().to_vec();
        bytes
            .as_chunks::<4>()
            .0
            .iter()
            .map(|b| f32::from_le_bytes(*b))
            .collect()
    }

    fn problem(&self, with_balls: bool) -> Problem {
        let (start, target) = (self.values("start"), self.values("target"));
        let balls = self.values("balls");
        let balls = balls
            .as_chunks::<4>()
            .0
            .iter()
            .filter(|_| with_balls)
            .map(|ball| {
                let [x, y, z, radius] = ball.map(f64::from);
                Ball {
                    centre: Point::new(x, y, z),
                    radius,
                }
            });
        Problem {
            start: Configuration::from_fn(|i, _| f64::from(start[i])),
            goal: Goal::Tip(Point::from_fn(|i, _| f64::from(target[i]))),
            scene: Scene::new(balls.collect()).unwrap(),
            moving: MovingObstacles::default(),
        }
    }
}

fn model(steps: usize) -> DiffusionModel {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixtures");
    let file = Manifest::open(Path::new(folder))
        .unwrap()
        .weights("sampled")
        .unwrap();
    let unet = TemporalUnet::load(&file, unit_robot().bending_limit).unwrap();
    let settings = DiffusionSettings {
        solver: Solver::Ddim,
        steps,
        precision: Precision::F32,
    };
    DiffusionModel::new(unet, settings).unwrap()
}

/// ‖a − b‖ ÷ ‖b‖.
fn relative_error(found: &[f32], expected: &[f32]) -> f32 {
    assert_eq!(found.len(), expected.len());
    let norm = |values: &mut dyn Iterator<Item = f32>| values.map(|v| v * v).sum::<f32>().sqrt();
    norm(&mut found.iter().zip(expected).map(|(a, b)| a - b)) / norm(&mut expected.iter().copied())
}

#[test]
fn samples_are_those_of_pytorch() {
    let (fixture, robot) = (Fixture::read(), unit_robot());
    for (scene, with_balls) in [("free", false), ("mixed", true)] {
        let problem = fixture.problem(with_balls);
        for (name, guidance, steps) in [
            ("pure", Guidance::Pure, 50),
            ("post", Guidance::Post, 50),
            ("guided", Guidance::Guided, 10),
        ] {
            let model = model(steps);
            let task = Task {
                robot: &robot,
                problem: &problem,
                guidance,
                seed: 0,
            };
            let mut paths = fixture.values("noise");
            let condition = model.condition(&task);
            let mut observe = |_: &[f32]| ControlFlow::Continue(());
            assert!(
                model
                    .run(&task, &condition, &mut paths, &mut observe)
                    .is_continue()
            );
            let found = model.physical(&paths, true).into_iter().flatten().flatten();
            let found: Vec<f32> = found
                .flat_map(|q| q.iter().map(|v| *v as f32).collect::<Vec<_>>())
                .collect();
            let error = relative_error(&found, &fixture.values(&format!("{scene}.{name}")));
            assert!(error <= 1e-4, "{scene} {name}: relative error {error:e}");
            println!("parity of {name} sample of {steps} steps, {scene}: {error:.1e}");
        }
    }
}

#[test]
fn the_scene_of_the_fixture_calls_for_both_refinements() {
    let (fixture, robot) = (Fixture::read(), unit_robot());
    let problem = fixture.problem(true);
    let margin = REPULSION * robot.largest_tube_radius();
    let pushed = |name: &str| {
        let values = fixture.values(name);
        let configurations = values.as_chunks::<DOF>().0.iter();
        let configurations =
            configurations.map(|frame| Configuration::from_fn(|i, _| f64::from(frame[i])));
        let near = |configuration: &Configuration| {
            let deepest = deepest(&robot.backbone(configuration), problem.scene.balls());
            deepest.is_some_and(|d| d.distance < margin)
        };
        configurations.filter(near).count()
    };
    assert!(pushed("mixed.pure") > 0, "frames that repulsion acts on");
    for name in ["mixed.post", "mixed.guided"] {
        assert!(pushed(name) < pushed("mixed.pure"), "{name}");
        let change = relative_error(&fixture.values(name), &fixture.values("mixed.pure"));
        assert!(change > 1e-2, "{name}: {change}");
    }
}

#[test]
fn threads_and_neighbours_do_not_matter_and_an_interrupt_leaves_nothing_half_done() {
    let (fixture, robot) = (Fixture::read(), unit_robot());
    let problem = fixture.problem(true);
    let task = Task {
        robot: &robot,
        problem: &problem,
        guidance: Guidance::Post,
        seed: 3,
    };
    let drawn = |threads, count| {
        let mut model = model(5);
        model.prepare(threads);
        model.sample(&task, count, &|| false)
    };
    let reference = drawn(1, 7);
    assert_eq!(drawn(2, 7), reference);
    assert_eq!(drawn(3, 4), reference[..4]);
    assert_ne!(reference[0], reference[1]);
    assert!(reference.iter().all(Option::is_some));
    let mut interrupted = model(5);
    interrupted.prepare(1);
    let drawn = interrupted.sample(&task, 7, &|| true);
    assert_eq!(drawn, vec![None; 7]);
}

#[test]
fn the_noise_of_candidates_is_normal_and_that_of_neighbours_is_unrelated() {
    let drawn: Vec<[f32; PATH]> = (0..64).map(|index| noise(7, index)).collect();
    let product = |a: &[f32; PATH], b: &[f32; PATH]| {
        let sum: f32 = a.iter().zip(b).map(|(x, y)| x * y).sum();
        sum / PATH as f32
    };
    for (i, a) in drawn.iter().enumerate() {
        assert!((product(a, a) - 1.0).abs() < 0.35, "variance of {i}");
        for b in &drawn[..i] {
            assert!(product(a, b).abs() < 0.25, "candidate {i} and one before");
        }
    }
    assert_eq!(drawn[5], noise(7, 5));
    assert_ne!(drawn[5], noise(8, 5));
}

#[test]
fn a_trace_begins_with_noise_and_ends_with_the_sample() {
    let (fixture, robot) = (Fixture::read(), unit_robot());
    let problem = fixture.problem(true);
    let task = Task {
        robot: &robot,
        problem: &problem,
        guidance: Guidance::Pure,
        seed: 3,
    };
    let mut model = model(6);
    let trace = model.trace(&task);
    assert_eq!(trace.len(), 7);
    model.prepare(1);
    assert_eq!(
        Some(&trace[6]),
        model.sample(&task, 1, &|| false)[0].as_ref()
    );
    assert!(
        trace
            .iter()
            .all(|path| (path[0] - problem.start).norm() < 1e-5),
        "the start is held"
    );
}
