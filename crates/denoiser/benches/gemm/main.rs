//! How fast the packed products are, and how much of the processor they use: `cargo bench -p denoiser --bench gemm`.
//!
//! For the products of a temporal U-Net on the candidates of one core, in 10⁹ multiply-adds a second and as a share of
//! what the same instructions reach without memory. "warm": one matrix again and again. "cold": many matrices in turn,
//! more than the caches of a core hold, as a whole network finds them.
#![allow(unsafe_code)] // the peak of tiles may be measured only where there are any

mod peak;

use denoiser::gemm::{Batch, Bf16Buffer, Bf16Unit, Input, Packed, Precision, Store, Strides};
use std::time::Instant;

const CANDIDATES: usize = 5;
/// Rows of a candidate, inputs, outputs, and the distance between rows of x.
const SHAPES: [(usize, usize, usize, usize); 4] = [
    (64, 192, 64, 64),
    (32, 384, 128, 128),
    (16, 768, 256, 256),
    (16, 1536, 256, 512),
];
/// Weights of all matrices together when they are to be cold.
const COLD_WEIGHTS: usize = 6_000_000;
const REPEATS: usize = 40;
/// Values of a cache line: results that straddle two take longer to write.
const LINE: usize = 16;

fn main() {
    let peaks = Peaks::measure();
    println!("{peaks:#.1?}");
    println!("rows inputs outputs         f32 warm      cold, bf16 by unit warm      cold");
    for (rows, inputs, outputs, stride) in SHAPES {
        print!("{:4} {inputs:6} {outputs:7}", CANDIDATES * rows);
        let batch = batch(rows, inputs, outputs, stride);
        let x = vec![0.3; CANDIDATES * batch.from.candidate];
        let mut rounded = Bf16Buffer::default();
        if Precision::Bf16.available() {
            rounded.fill(&x);
        }
        let mut memory = vec![0.0; CANDIDATES * batch.to.candidate + LINE];
        let first = memory.as_ptr().align_offset(LINE * size_of::<f32>());
        let out = &mut memory[first..];
        let mut report = |peak: Option<f64>, product: &dyn Fn(&Packed, &mut [f32])| {
            let products = CANDIDATES * rows * inputs * outputs;
            for count in [1, COLD_WEIGHTS / (inputs * outputs)] {
                let matrices: Vec<_> = (0..count).map(|_| matrix(inputs, outputs)).collect();
                let seconds = time(&matrices, |matrix| product(matrix, out));
                let rate = products as f64 / seconds / 1e9;
                let share = peak.map_or(f64::NAN, |peak| 100.0 * rate / peak);
                print!(" {rate:7.1} ({share:2.0} %)");
            }
        };
        report(peaks.f32_fma, &|matrix, out| {
            matrix.multiply(Input::F32(&x), out, batch, Store::Replace);
        });
        for unit in Bf16Unit::detected() {
            print!("  {unit:?}");
            report(peaks.of(*unit), &|matrix, out| {
                matrix.multiply_on(*unit, rounded.values(), out, batch, Store::Replace);
            });
        }
        println!();
    }
}

/// The most that each kind of multiply-add reaches, in 10⁹ a second.
#[derive(Debug)]
struct Peaks {
    f32_fma: Option<f64>,
    bf16_avx512: Option<f64>,
    bf16_amx: Option<f64>,
}

impl Peaks {
    fn measure() -> Self {
        let has_tiles = Bf16Unit::detected()
            .iter()
            .any(|unit| matches!(unit, Bf16Unit::Amx(_)));
        Self {
            f32_fma: peak::f32_fma(),
            bf16_avx512: peak::bf16_avx512(),
            // SAFETY: the unit exists only where this process may use tiles.
            bf16_amx: has_tiles.then(|| unsafe { peak::bf16_amx() }),
        }
    }

    fn of(&self, unit: Bf16Unit) -> Option<f64> {
        match unit {
            Bf16Unit::Avx512(_) => self.bf16_avx512,
            Bf16Unit::Amx(_) => self.bf16_amx,
        }
    }
}

/// Windows of padded time-major activations.
fn batch(rows: usize, inputs: usize, outputs: usize, stride: usize) -> Batch {
    let from = Strides {
        row: stride,
        candidate: (rows - 1) * stride + inputs,
    };
    let to = Strides {
        row: outputs,
        candidate: rows * outputs,
    };
    Batch {
        candidates: CANDIDATES,
        rows,
        from,
        to,
    }
}

fn matrix(inputs: usize, outputs: usize) -> Packed {
    let weight: Vec<_> = (0..inputs * outputs)
        .map(|i| (i * 7919 % 1000) as f32 * 1e-3 - 0.5)
        .collect();
    let packed = Packed::new(&weight, &vec![0.1; outputs]);
    if Precision::Bf16.available() {
        packed.prepare(Precision::Bf16);
    }
    packed
}

/// Seconds a product, over all matrices in turn, the best of several runs.
fn time(matrices: &[Packed], mut product: impl FnMut(&Packed)) -> f64 {
    let mut run = || {
        let start = Instant::now();
        matrices.iter().for_each(&mut product);
        start.elapsed().as_secs_f64() / matrices.len() as f64
    };
    (0..REPEATS).map(|_| run()).fold(f64::MAX, f64::min)
}
