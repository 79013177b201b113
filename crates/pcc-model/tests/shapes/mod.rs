//! Robots and seeded random shapes for the tests.
#![allow(dead_code, reason = "each test binary uses its part")]

use pcc_model::{Configuration, Point, Robot};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::f64::consts::{FRAC_PI_2, TAU};
use std::path::PathBuf;

pub(crate) fn robot_file(name: &str) -> PathBuf {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../config/robots");
    root.join(name)
}

pub(crate) fn unit_robot() -> Robot {
    Robot::from_file(&robot_file("unit.toml")).unwrap()
}

pub(crate) fn authors_robot() -> Robot {
    Robot::from_file(&robot_file("authors-42mm.toml")).unwrap()
}

pub(crate) fn random(seed: u64) -> Pcg64 {
    Pcg64::seed_from_u64(seed)
}

/// A shape with the three bending angles and bending directions (rad).
pub(crate) fn shape_of(angles: [f64; 3], directions: [f64; 3]) -> Configuration {
    Configuration::from_fn(|row, _| {
        let (angle, direction) = (angles[row / 2], directions[row / 2]);
        angle * [direction.cos(), direction.sin()][row % 2]
    })
}

/// Section angles of every kind: exactly zero, tiny, about the switches to series, up to the limit, at the limit.
pub(crate) fn any_angle(random: &mut Pcg64) -> f64 {
    match random.random_range(0..10) {
        0 => 0.0,
        1 => 10.0_f64.powf(random.random_range(-12.0..-3.0)),
        2 => random.random_range(0.02..0.05),
        3 => random.random_range(0.24..0.25),
        4 => FRAC_PI_2,
        _ => random.random_range(0.0..FRAC_PI_2),
    }
}

pub(crate) fn any_shape(random: &mut Pcg64) -> Configuration {
    let angles = std::array::from_fn(|_| any_angle(random));
    shape_of(
        angles,
        std::array::from_fn(|_| random.random_range(0.0..TAU)),
    )
}

/// A point in the box that a robot of three unit sections moves in.
pub(crate) fn any_point(random: &mut Pcg64) -> Point {
    let mut within = |low: f64, high: f64| random.random_range(low..high);
    Point::new(within(-2.5, 2.5), within(-2.5, 2.5), within(-1.5, 3.5))
}
