//! Times the few-step sampler on one core: `cargo run --release -p denoiser --example sampling_time -- FOLDER [NAME]`.
//!
//! Prints the median and the 99th percentile, in microseconds, of a whole sample (context and two evaluations) for
//! 1, 5, 10 and 16 candidates among six balls. FOLDER holds `MANIFEST.toml`; NAME is `fast` unless given.

use denoiser::{CandidateInput, FastModel, FastScratch, Manifest};
use std::path::Path;
use std::time::Instant;

const REPETITIONS: usize = 300;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = arguments.next().unwrap_or_else(|| "weights".into());
    let name = arguments.next().unwrap_or_else(|| "fast".into());
    let file = Manifest::open(Path::new(&folder))?.weights(&name)?;
    let model = FastModel::from_weights(&file, std::f64::consts::FRAC_PI_2)?;
    for (count, balls) in [(1, 6), (5, 6), (5, 16), (10, 6), (10, 16), (16, 16)] {
        let times = time(&model, count, balls);
        let at = |share: f64| times[(share * (times.len() - 1) as f64) as usize];
        println!(
            "{count:2} candidates, {balls} balls: shortest {:.0}, median {:.0} µs, p99 {:.0} µs",
            at(0.0),
            at(0.5),
            at(0.99)
        );
    }
    Ok(())
}

/// Sorted durations, µs.
fn time(model: &FastModel, count: usize, ball_count: usize) -> Vec<f64> {
    let (ends, balls) = (wave(36), wave(28 * ball_count));
    let candidate = CandidateInput {
        ends: &ends,
        balls: &balls,
    };
    let candidates = vec![candidate; count];
    let (noise, mut out) = (wave(72 * count), vec![0.0; 72 * count]);
    let mut scratch = FastScratch::default();
    let mut once = |_| {
        let began = Instant::now();
        model.sample(&candidates, &noise, 2, &mut scratch, &mut out);
        began.elapsed().as_secs_f64() * 1e6
    };
    let mut times: Vec<f64> = (0..REPETITIONS).map(&mut once).collect();
    times.sort_by(f64::total_cmp);
    times
}

/// Numbers of the size of normalised features.
fn wave(count: usize) -> Vec<f32> {
    (0..count).map(|i| (i as f32 * 0.7).sin()).collect()
}
