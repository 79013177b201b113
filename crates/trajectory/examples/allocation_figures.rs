//! Measures time parameterization on seeded paths of the unit robot: `cargo run --release --example allocation_figures`.
//!
//! Prints, for 200 smooth paths of 64 waypoints and 200 polylines of 6: duration ÷ (TOPP-RA's + 2a/j) and ÷ TOPP-RA's
//! on a fine grid, limit use, knots, deviation from the waypoints' polyline, and the time a call takes.

use pcc_model::Configuration;
use rand::SeedableRng;
use rand_pcg::Pcg64;
use std::time::Instant;
use trajectory::{ParameterizationError, ParameterizationOptions, TimeParameterizer, limit_use};

#[path = "../src/test_paths.rs"]
mod test_paths;
use test_paths::{cornered_path, smooth_path, unit_limits, unit_tendons};

fn deviation(path: &[Configuration], samples: &[Configuration]) -> f64 {
    let to_chord = |point: &Configuration, from: &Configuration, to: &Configuration| {
        let chord = to - from;
        let part = ((point - from).dot(&chord) / chord.norm_squared()).clamp(0.0, 1.0);
        (from + chord * part - point).norm()
    };
    let nearest = |point: &Configuration| {
        path.windows(2)
            .map(|pair| to_chord(point, &pair[0], &pair[1]))
            .fold(f64::INFINITY, f64::min)
    };
    samples.iter().map(nearest).fold(0.0, f64::max)
}

fn summary(name: &str, mut values: Vec<f64>) {
    values.sort_by(f64::total_cmp);
    let at = |part: f64| values[((values.len() - 1) as f64 * part) as usize];
    println!(
        "{name:<34} median {:>10.5}  p90 {:>10.5}  max {:>10.5}",
        at(0.5),
        at(0.9),
        at(1.0)
    );
}

const NAMES: [&str; 7] = [
    "duration, s",
    "duration / (TOPP-RA + 2a/j)",
    "duration / TOPP-RA, 2000 intervals",
    "largest limit use",
    "knots",
    "deviation from polyline, rad",
    "time of a call, µs",
];

fn report(title: &str, paths: &[Vec<Configuration>]) -> Result<(), ParameterizationError> {
    let (tendons, limits) = (unit_tendons(), unit_limits());
    let options = ParameterizationOptions::default();
    let fine = ParameterizationOptions {
        grid_intervals: 2000,
        ..options
    };
    let (mut parameterizer, mut reference) =
        (TimeParameterizer::default(), TimeParameterizer::default());
    parameterizer.parameterize(&paths[0], &tendons, &limits, &options)?;
    let mut figures: [Vec<f64>; 7] = Default::default();
    for path in paths {
        let started = Instant::now();
        let motion = parameterizer.parameterize(path, &tendons, &limits, &options)?;
        let seconds = started.elapsed().as_secs_f64();
        let unbounded = parameterizer.fastest_duration(path, &tendons, &limits, &options)?;
        let finest = reference.fastest_duration(path, &tendons, &limits, &fine)?;
        let width = 2.0 * limits.acceleration / limits.jerk;
        let row = [
            motion.duration(),
            motion.duration() / (unbounded + width),
            motion.duration() / finest,
            limit_use(&motion, &tendons, &limits).largest(),
            motion.knots().len() as f64,
            deviation(path, &motion.sample(2000)),
            1e6 * seconds,
        ];
        figures
            .iter_mut()
            .zip(row)
            .for_each(|(figure, value)| figure.push(value));
    }
    println!("{title}");
    NAMES
        .into_iter()
        .zip(figures)
        .for_each(|(name, values)| summary(name, values));
    Ok(())
}

fn main() -> Result<(), ParameterizationError> {
    let mut random = Pcg64::seed_from_u64(5);
    let smooth: Vec<_> = (0..200).map(|_| smooth_path(&mut random, 64)).collect();
    let cornered: Vec<_> = (0..200).map(|_| cornered_path(&mut random, 6)).collect();
    report("smooth paths of 64 waypoints", &smooth)?;
    report("polylines of 6 waypoints", &cornered)
}
