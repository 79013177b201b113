//! Drawing configurations at random.

use pcc_model::{Configuration, Robot, SECTIONS};
use rand::RngExt;
use rand_pcg::Pcg64;
use std::f64::consts::TAU;

/// A configuration uniform in each section's disc of allowed bending.
#[must_use]
pub fn random_configuration(robot: &Robot, rng: &mut Pcg64) -> Configuration {
    let mut configuration = Configuration::zeros();
    for section in 0..SECTIONS {
        let angle = robot.bending_limit * rng.random::<f64>().sqrt();
        let (sine, cosine) = (TAU * rng.random::<f64>()).sin_cos();
        configuration[2 * section] = angle * cosine;
        configuration[2 * section + 1] = angle * sine;
    }
    configuration
}
