//! Seeded random shapes, scenes and motions for the tests.
#![allow(dead_code, reason = "each test binary uses its part")]

use collision::{Ball, Scene};
use pcc_model::{Configuration, Point, Robot, SECTIONS};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::f64::consts::{FRAC_PI_2, TAU};
use std::path::PathBuf;
use trajectory::{Knot, Trajectory};

pub(crate) fn unit_robot() -> Robot {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    Robot::from_file(&root.join("../../config/robots/unit.toml")).unwrap()
}

/// A thin robot with unequal sections, so that no two of them can be mixed up.
pub(crate) fn uneven_robot() -> Robot {
    Robot {
        section_lengths: [1.0, 0.7, 1.3],
        tube_radii: [0.1, 0.09, 0.11],
        ..unit_robot()
    }
}

pub(crate) fn random(seed: u64) -> Pcg64 {
    Pcg64::seed_from_u64(seed)
}

/// Uniform in the discs of radius `limit` rad; one section in eight is exactly straight.
pub(crate) fn shape(random: &mut Pcg64, limit: f64) -> Configuration {
    let mut shape = Configuration::zeros();
    for i in 0..SECTIONS {
        if random.random_range(0..8) > 0 {
            let angle = limit * random.random::<f64>().sqrt();
            let direction = random.random_range(0.0..TAU);
            shape[2 * i] = angle * direction.cos();
            shape[2 * i + 1] = angle * direction.sin();
        }
    }
    shape
}

/// A step of the given length in a random direction of the configuration space.
pub(crate) fn step(random: &mut Pcg64, length: f64) -> Configuration {
    let direction = Configuration::from_fn(|_, _| random.random_range(-1.0..1.0));
    direction.normalize() * length
}

pub(crate) fn ball(random: &mut Pcg64, radii: std::ops::Range<f64>) -> Ball {
    let mut within = |low: f64, high: f64| random.random_range(low..high);
    let centre = Point::new(within(-2.0, 2.0), within(-2.0, 2.0), within(-0.5, 3.0));
    Ball {
        centre,
        radius: within(radii.start, radii.end),
    }
}

pub(crate) fn scene(random: &mut Pcg64, count: usize, radii: std::ops::Range<f64>) -> Scene {
    let mut balls = || (0..count).map(|_| ball(random, radii.clone())).collect();
    Scene::new(balls()).unwrap()
}

/// A motion of 2 to 80 knots along a random curve, at times that are not evenly spaced; 3 to 6 s long.
///
/// One in four has random velocities and accelerations at its knots, so that its segments swing out between them.
pub(crate) fn motion(random: &mut Pcg64) -> Trajectory {
    let count = random.random_range(2..=80);
    let (start, end) = (shape(random, FRAC_PI_2), shape(random, FRAC_PI_2));
    let (height, swings) = (
        random.random_range(0.0..1.0),
        random.random_range(0..4) == 0,
    );
    let (bulge, swing) = (step(random, height), if swings { 3.0 } else { 0.0 });
    let mut time = 0.0;
    let mut knots = Vec::new();
    for i in 0..count {
        let u = f64::from(i) / f64::from(count - 1);
        let slope = end - start + bulge * (TAU * (TAU * u).cos());
        knots.push(Knot {
            time,
            position: start + (end - start) * u + bulge * (TAU * u).sin(),
            velocity: slope * 0.2 + step(random, swing) / f64::from(count),
            acceleration: step(random, swing),
        });
        time += random.random_range(3.0..6.0) / f64::from(count - 1);
    }
    Trajectory::new(knots).unwrap()
}

/// Smallest clearance of the body over `count` even samples of a motion from a time on.
pub(crate) fn sampled_clearance(
    robot: &Robot,
    scene: &Scene,
    motion: &Trajectory,
    from_time: f64,
    count: u32,
) -> f64 {
    (0..=count)
        .map(|i| from_time + (motion.duration() - from_time) * f64::from(i) / f64::from(count))
        .map(|t| scene.clearance(&robot.backbone(&motion.at(t).position), &robot.tube_radii))
        .fold(f64::INFINITY, f64::min)
}
