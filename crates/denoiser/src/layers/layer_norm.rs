//! Layer normalisation.

use crate::layers::group_norm::Affine;
use crate::simd::dispatch::{Kernel, dispatch};
use crate::simd::lanes::{LANES, Lanes};
use crate::weights::error::WeightsError;
use crate::weights::file::WeightsFile;

/// The ε that keeps the divisor from zero: PyTorch's default.
const EPSILON: f32 = 1e-5;

/// Normalises each row: y = (x − mean of the row) / √(variance of the row + ε) · weight + bias.
pub(crate) struct LayerNorm(Affine);

impl LayerNorm {
    /// Loads `name`.weight and `name`.bias.
    pub(crate) fn load(file: &WeightsFile, name: &str, width: usize) -> Result<Self, WeightsError> {
        Affine::load(file, name, width).map(Self)
    }

    /// Normalises `rows` (rows × width) into `out`.
    pub(crate) fn apply(&self, rows: &[f32], out: &mut [f32]) {
        dispatch(Normalise {
            affine: &self.0,
            rows,
            out,
        });
    }
}

struct Normalise<'a> {
    affine: &'a Affine,
    rows: &'a [f32],
    out: &'a mut [f32],
}

impl Kernel for Normalise<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let Affine { gain, offset } = self.affine;
        let width = gain.len();
        let rows = self.rows.chunks_exact(width);
        for (x, y) in rows.zip(self.out.chunks_exact_mut(width)) {
            let mean = sum(x, |v| v) / width as f32;
            let variance = sum(x, |v| (v - mean) * (v - mean)) / width as f32;
            let scale = 1.0 / (variance + EPSILON).sqrt();
            let affine = gain.iter().zip(offset);
            for ((y, x), (w, b)) in y.iter_mut().zip(x).zip(affine) {
                *y = (x - mean) * scale * w + b;
            }
        }
    }
}

/// Sums in a fixed order with independent lanes, so that it vectorises and repeats bit for bit.
#[inline(always)]
fn sum(values: &[f32], of: impl Fn(f32) -> f32) -> f32 {
    let mut lanes = [0.0_f32; LANES];
    let (chunks, rest) = values.as_chunks::<LANES>();
    for chunk in chunks {
        for (lane, v) in lanes.iter_mut().zip(chunk) {
            *lane += of(*v);
        }
    }
    let rest: f32 = rest.iter().map(|v| of(*v)).sum();
    lanes.iter().sum::<f32>() + rest
}
