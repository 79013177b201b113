//! Layer normalisation.

use crate::simd::dispatch::{Kernel, dispatch};
use crate::simd::lanes::Lanes;
use crate::weights::error::WeightsError;
use crate::weights::file::WeightsFile;

/// The ε that keeps the divisor from zero: PyTorch's default.
const EPSILON: f32 = 1e-5;
const LANES: usize = 16;

/// y = (x − mean) / √(variance + ε) · weight + bias, row by row.
pub(crate) struct LayerNorm {
    weight: Vec<f32>,
    bias: Vec<f32>,
}

impl LayerNorm {
    pub(crate) fn load(file: &WeightsFile, name: &str, width: usize) -> Result<Self, WeightsError> {
        let part = |suffix: &str| {
            file.tensor(&format!("{name}.{suffix}"), &[width])
                .map(<[f32]>::to_vec)
        };
        Ok(Self {
            weight: part("weight")?,
            bias: part("bias")?,
        })
    }

    /// Normalises `rows` (rows × width) into `out`.
    pub(crate) fn apply(&self, rows: &[f32], out: &mut [f32]) {
        dispatch(Normalise {
            norm: self,
            rows,
            out,
        });
    }
}

struct Normalise<'a> {
    norm: &'a LayerNorm,
    rows: &'a [f32],
    out: &'a mut [f32],
}

impl Kernel for Normalise<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let LayerNorm { weight, bias } = self.norm;
        let width = weight.len();
        let rows = self.rows.chunks_exact(width);
        for (x, y) in rows.zip(self.out.chunks_exact_mut(width)) {
            let mean = sum(x, |v| v) / width as f32;
            let variance = sum(x, |v| (v - mean) * (v - mean)) / width as f32;
            let scale = 1.0 / (variance + EPSILON).sqrt();
            let affine = weight.iter().zip(bias);
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
