//! Times the few-step sampler on one core: `cargo run --release -p denoiser --example sampling_time -- FOLDER [NAME]`.
//!
//! Prints the shortest time, the median and the 99th percentile, in microseconds, of a whole sample (context and the
//! evaluations that the weights are for) in each precision. "near" is one sample after the other; before a "far" one
//! other memory is read, as a planner's other stages do. FOLDER holds `MANIFEST.toml`; NAME is `fast` unless given.

use denoiser::{CandidateInput, FastModel, FastScratch, Manifest, Precision};
use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

/// Candidates, and balls of each.
const SIZES: [(usize, usize); 6] = [(1, 6), (5, 6), (5, 16), (10, 6), (10, 16), (16, 16)];
const REPETITIONS: usize = 500;
/// Words of other memory: more than the caches of a core hold.
const OTHER: usize = 4 << 20;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = arguments.next().unwrap_or_else(|| "weights".into());
    let name = arguments.next().unwrap_or_else(|| "fast".into());
    let file = Manifest::open(Path::new(&folder))?.weights(&name)?;
    for precision in [Precision::F32, Precision::Bf16] {
        if !precision.available() {
            continue;
        }
        let model = FastModel::from_weights(&file, std::f64::consts::FRAC_PI_2)?;
        let model = model.with_precision(precision);
        for (count, balls) in SIZES {
            for (words, distance) in [(0, "near"), (OTHER, "far")] {
                let times = time(&model, count, balls, words);
                let at = |share: f64| times[(share * (times.len() - 1) as f64) as usize];
                println!(
                    "{precision:4} {count:2} candidates, {balls:2} balls, {distance:4}: {:5.0}, median {:5.0}, p99 {:5.0} µs",
                    at(0.0),
                    at(0.5),
                    at(0.99)
                );
            }
        }
    }
    Ok(())
}

/// Sorted durations, µs, with `words` of other memory read before each.
fn time(model: &FastModel, count: usize, ball_count: usize, words: usize) -> Vec<f64> {
    let (ends, balls) = (wave(36), wave(28 * ball_count));
    let candidate = CandidateInput {
        ends: &ends,
        balls: &balls,
        warm_start: None,
    };
    let candidates = vec![candidate; count];
    let (noise, mut out) = (wave(72 * count), vec![0.0; 72 * count]);
    let other = vec![1_u64; words];
    let mut scratch = FastScratch::default();
    let mut once = |_| {
        black_box(other.iter().sum::<u64>());
        let began = Instant::now();
        model.sample(&candidates, &noise, &mut scratch, &mut out);
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
