//! What the paper's generator is built of, for planners that are built of the same.

pub use crate::paper::path_maker::{Obstruction, PathMaker};
pub use crate::paper::settings::LARGEST_STEP;
pub use crate::paper::target::Surroundings;

use crate::scenes::{WORKSPACE_HEIGHTS, WORKSPACE_RADII};
use pcc_model::Point;
use rand::RngExt;
use rand_pcg::Pcg64;
use std::f64::consts::TAU;

/// A point uniform in the workspace of targets, section lengths.
pub fn random_workspace_point(rng: &mut Pcg64) -> Point {
    let [least, most] = [WORKSPACE_RADII.start(), WORKSPACE_RADII.end()].map(|r| r * r);
    let radius = rng.random_range(least..most).sqrt();
    let (sine, cosine) = (TAU * rng.random::<f64>()).sin_cos();
    Point::new(
        radius * cosine,
        radius * sine,
        rng.random_range(WORKSPACE_HEIGHTS),
    )
}
