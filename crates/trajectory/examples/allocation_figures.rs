//! Measures time allocation on seeded smooth paths of the unit robot: `cargo run --release --example allocation_figures`.
//!
//! Prints, over 200 paths of 64 waypoints: duration ÷ (TOPP-RA's duration + 2a/j), limit use, knots, deviation from
//! the waypoints' polyline, and the time a call takes.

use pcc_model::{Configuration, Tendon, TendonLimits, TendonMap};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::time::Instant;
use trajectory::{AllocationOptions, Allocator, limit_use};

fn unit_tendons() -> TendonMap {
    let offsets = [(1, 0.0), (3, 80.0f64), (2, 40.0)];
    let tendon = |section, degrees: f64| Tendon {
        section,
        radius: 0.1636,
        angle: degrees.to_radians(),
    };
    let group = |(section, offset): (usize, f64)| {
        [0.0, 120.0, 240.0].map(|turn| tendon(section, offset + turn))
    };
    TendonMap::new(offsets.into_iter().flat_map(group).collect())
        .expect("the unit robot's tendons are valid")
}

fn smooth_path(random: &mut Pcg64) -> Vec<Configuration> {
    let mut vector = || Configuration::from_fn(|_, _| random.random_range(-1.0..1.0));
    let (start, end) = (vector(), vector());
    let waves: Vec<_> = (1..=4)
        .map(|k| (f64::from(k), vector() * (0.5 / f64::from(k * k))))
        .collect();
    let point = |u: f64| {
        let straight = start + (end - start) * u;
        waves.iter().fold(straight, |sum, (k, wave)| {
            sum + wave * (std::f64::consts::PI * u * k).sin()
        })
    };
    (0..64).map(|i| point(f64::from(i) / 63.0)).collect()
}

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

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (tendons, limits) = (
        unit_tendons(),
        TendonLimits {
            velocity: 0.0779,
            acceleration: 0.390,
            jerk: 3.9,
        },
    );
    let options = AllocationOptions::default();
    let fine = AllocationOptions {
        grid_intervals: 2000,
        ..options
    };
    let mut random = Pcg64::seed_from_u64(5);
    let paths: Vec<_> = (0..200).map(|_| smooth_path(&mut random)).collect();
    let (mut allocator, mut reference) = (Allocator::default(), Allocator::default());
    allocator.allocate(&paths[0], &tendons, &limits, &options)?;
    let mut figures: [Vec<f64>; 7] = Default::default();
    for path in &paths {
        let started = Instant::now();
        let motion = allocator.allocate(path, &tendons, &limits, &options)?;
        let seconds = started.elapsed().as_secs_f64();
        reference.allocate(path, &tendons, &limits, &fine)?;
        let (fastest, optimum) = (
            allocator.unfiltered_duration(),
            reference.unfiltered_duration(),
        );
        let width = 2.0 * limits.acceleration / limits.jerk;
        let largest = limit_use(&motion, &tendons, &limits).largest();
        let row = [
            motion.duration(),
            motion.duration() / (fastest + width),
            motion.duration() / optimum,
            largest,
            motion.knots().len() as f64,
            deviation(path, &motion.sample(2000)),
            1e6 * seconds,
        ];
        figures
            .iter_mut()
            .zip(row)
            .for_each(|(figure, value)| figure.push(value));
    }
    let names = [
        "duration, s",
        "duration / (TOPP-RA + 2a/j)",
        "duration / TOPP-RA, 2000 intervals",
        "largest limit use",
        "knots",
        "deviation from polyline, rad",
        "time of a call, µs",
    ];
    names
        .into_iter()
        .zip(figures)
        .for_each(|(name, values)| summary(name, values));
    Ok(())
}
