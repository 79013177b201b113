//! Times the network's part of a sample, order by order, so that other programs can take turns with it.
//!
//! `cargo run --release -p denoiser --example unet_time -- FOLDER NAME`, for weights in a folder with `MANIFEST.toml`.
//! Every line `PRECISION THREADS` (`f32 2`, `bf16 1`) is answered by the seconds that ten candidates take over 50 steps
//! among four balls: the condition, its preparation for the steps, and the predictions, a part of the candidates on
//! each thread. `scripts/bench_unet.py` does the same with PyTorch and ONNX Runtime.

use denoiser::{FRAME, HORIZON, Manifest, Precision, TemporalUnet, UnetScratch};
use std::io::{BufRead, stdin};
use std::path::Path;
use std::time::Instant;

const CANDIDATES: usize = 10;
const STEPS: usize = 50;
const LAST_STEP: f32 = 999.0;
const PATH: usize = HORIZON * FRAME;
const START: [f32; FRAME] = [0.1; FRAME];
const TARGET: [f32; 3] = [0.5, 0.3, 2.4];
/// The reference's layout of four.
const BALLS: [[f32; 4]; 4] = [
    [0.85, 0.85, 1.5, 0.4],
    [0.85, -0.85, 1.5, 0.4],
    [-0.85, 0.85, 1.5, 0.4],
    [-0.85, -0.85, 1.5, 0.4],
];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = arguments.next().ok_or("which FOLDER?")?;
    let name = arguments.next().ok_or("which NAME?")?;
    let file = Manifest::open(Path::new(&folder))?.weights(&name)?;
    let unet = TemporalUnet::load(&file, file.number("theta_max")?)?;
    println!("weights {name}, {CANDIDATES} candidates, {STEPS} steps");
    let mut scratch = Vec::new();
    for line in stdin().lock().lines() {
        let line = line?;
        let (precision, threads) = line.split_once(' ').ok_or("PRECISION THREADS")?;
        let precision = match precision {
            "f32" => Precision::F32,
            "bf16" => Precision::Bf16,
            _ => return Err("f32 and bf16 are the precisions".into()),
        };
        if !precision.available() {
            return Err("this processor has no products of 16 bits".into());
        }
        scratch.resize_with(threads.parse()?, UnetScratch::default);
        println!("{}", sample(&unet, precision, &mut scratch));
    }
    Ok(())
}

/// Seconds of one sample with a thread for each scratch; the weights are packed before.
fn sample(unet: &TemporalUnet, precision: Precision, scratch: &mut [UnetScratch]) -> f64 {
    unet.prepare_precision(precision);
    let part = CANDIDATES.div_ceil(scratch.len());
    let paths: Vec<f32> = (0..CANDIDATES * PATH)
        .map(|i| (i as f32 * 0.7).sin())
        .collect();
    let mut noise = vec![0.0; paths.len()];
    let began = Instant::now();
    let mut condition = unet.condition(&START, &TARGET, &BALLS);
    let steps: Vec<f32> = (0..STEPS)
        .map(|i| (LAST_STEP * i as f32 / (STEPS - 1) as f32).round())
        .collect();
    unet.prepare(&mut condition, &steps);
    let (condition, steps) = (&condition, &steps);
    std::thread::scope(|scope| {
        let parts = paths
            .chunks(part * PATH)
            .zip(noise.chunks_mut(part * PATH))
            .zip(scratch);
        for ((paths, noise), scratch) in parts {
            scope.spawn(move || {
                for step in steps.iter().rev() {
                    unet.predict(condition, *step, paths, precision, scratch, noise);
                }
            });
        }
    });
    began.elapsed().as_secs_f64()
}
