//! How fast the temporal U-Net is on one core, and how much of the processor it uses.
//!
//! `cargo bench -p denoiser --bench unet -- FOLDER NAME`, for weights of any width in a folder with `MANIFEST.toml`
//! (`scripts/fixtures_unet.py --width 64 --context 256 --graph 128 --out FOLDER` makes random ones, named `unet`).
//! Prints the shortest time of a prediction and of its gradient, and the share of what the product kernel of the same
//! precision reaches with all its data in the first cache.

use denoiser::gemm::{Batch, Bf16Buffer, Input, Packed, Precision, Store};
use denoiser::{FRAME, HORIZON, Manifest, TemporalUnet, UnetScratch, WeightsFile};
use std::path::Path;
use std::time::Instant;

const STEPS: [f32; 2] = [700.0, 300.0];
const REPEATS: usize = 100;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1).filter(|a| !a.starts_with("--"));
    let folder = arguments.next().ok_or("which FOLDER?")?;
    let name = arguments.next().unwrap_or_else(|| "unet".into());
    let file = Manifest::open(Path::new(&folder))?.weights(&name)?;
    let unet = TemporalUnet::load(&file, file.number("theta_max")?)?;
    let products = multiply_adds(&file)?;
    println!("{:.2} M multiply-adds a candidate", products / 1e6);
    for precision in [Precision::F32, Precision::Bf16] {
        if precision.available() {
            report(&unet, precision, products);
        }
    }
    Ok(())
}

fn report(unet: &TemporalUnet, precision: Precision, products: f64) {
    let peak = kernel_peak(precision);
    println!("{precision:?}: the product kernel reaches {peak:.1} G multiply-adds/s");
    unet.prepare_precision(precision);
    for candidates in [1, 5, 10] {
        let [forward, backward] = time(unet, precision, candidates);
        let rate = products * candidates as f64 / forward / 1e9;
        println!(
            "{candidates:2} candidates: {:7.0} µs, {rate:5.1} G/s, {:3.0} % of the kernel's; gradient {:7.0} µs, {:.2} of that",
            forward * 1e6,
            100.0 * rate / peak,
            backward * 1e6,
            backward / forward
        );
    }
}

/// Shortest times of a prediction and of its gradient, s.
fn time(unet: &TemporalUnet, precision: Precision, candidates: usize) -> [f64; 2] {
    let mut condition = unet.condition(&[0.1; 6], &[0.2; 3], &[[0.3, 0.2, 0.1, 0.1]; 4]);
    unet.prepare(&mut condition, &STEPS);
    let paths = wave(candidates * HORIZON * FRAME);
    let [mut noise, mut gradient] = [paths.clone(), paths.clone()];
    let mut s = UnetScratch::default();
    let mut once = |repeat: usize| {
        let step = STEPS[repeat % STEPS.len()];
        let began = Instant::now();
        unet.predict(&condition, step, &paths, precision, &mut s, &mut noise);
        let predicted = Instant::now();
        unet.pull_back(&mut s, &paths, &mut gradient);
        [predicted - began, predicted.elapsed()]
    };
    let times: Vec<_> = (0..REPEATS).map(&mut once).collect();
    [0, 1].map(|what| {
        let seconds = times.iter().map(|t| t[what].as_secs_f64());
        seconds.fold(f64::MAX, f64::min)
    })
}

/// What the product kernel reaches on data in the first cache, in 10⁹ multiply-adds a second.
fn kernel_peak(precision: Precision) -> f64 {
    const ROWS: usize = 48;
    const INPUTS: usize = 128;
    const OUTPUTS: usize = 32;
    let matrix = Packed::new(&wave(INPUTS * OUTPUTS), &wave(OUTPUTS));
    matrix.prepare(precision);
    let x = wave(ROWS * INPUTS);
    let mut rounded = Bf16Buffer::default();
    let input = match precision {
        Precision::F32 => Input::F32(&x),
        Precision::Bf16 => {
            rounded.fill(&x);
            Input::Bf16(rounded.values())
        }
    };
    let mut out = vec![0.0; ROWS * OUTPUTS];
    let batch = Batch::contiguous(ROWS, INPUTS, OUTPUTS);
    let mut seconds = || {
        let began = Instant::now();
        for _ in 0..500 {
            matrix.multiply(input, &mut out, batch, Store::Replace);
        }
        began.elapsed().as_secs_f64() / 500.0
    };
    let fastest = (0..REPEATS).map(|_| seconds()).fold(f64::MAX, f64::min);
    (ROWS * INPUTS * OUTPUTS) as f64 / fastest / 1e9
}

/// Multiply-adds of the convolutions of one candidate.
fn multiply_adds(file: &WeightsFile) -> Result<f64, Box<dyn std::error::Error>> {
    let width = file.count("width")?;
    let c = [width, 2 * width, 4 * width];
    let block = |inputs: usize, outputs: usize| {
        let skip = if inputs == outputs {
            0
        } else {
            inputs * outputs
        };
        3 * inputs * outputs + 3 * outputs * outputs + skip
    };
    let two_blocks = |inputs, outputs| block(inputs, outputs) + block(outputs, outputs);
    let (whole, half, quarter) = (HORIZON, HORIZON / 2, HORIZON / 4);
    let total = whole * (3 * (FRAME + 1) * c[0] + two_blocks(c[0], c[0]))
        + half * (4 * c[0] * c[0] + two_blocks(c[0], c[1]))
        + quarter * (4 * c[1] * c[1] + two_blocks(c[1], c[2]) + two_blocks(c[2], c[2]))
        + half * (2 * c[2] * c[1] + two_blocks(2 * c[1], c[1]))
        + whole * (2 * c[1] * c[0] + two_blocks(2 * c[0], c[0]) + 3 * c[0] * FRAME);
    Ok(total as f64)
}

/// Numbers of the size of normalised paths.
fn wave(count: usize) -> Vec<f32> {
    (0..count).map(|i| (i as f32 * 0.7).sin()).collect()
}
