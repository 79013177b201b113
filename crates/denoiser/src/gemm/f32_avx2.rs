//! f32 products with AVX2 and FMA.
//!
//! Sixteen registers hold the sums of six rows for half a panel, or of three rows for a whole one, with the weights of
//! an input. The weights of each half lie together, so that half a panel of a few hundred inputs stays in the first
//! cache while the rows go through it. Blocks of rows cross from one candidate to the next.
#![allow(unsafe_code)] // loads from slices into vector registers

use super::f32_panels::{HALF, Weights};
use super::job::{Bias, Job, PANEL, Store};
use crate::simd::prefetch::prefetch;
use std::arch::x86_64::*;

/// Values of a register.
const LANES: usize = 8;
/// Rows whose sums for half a panel fit the registers.
const ROWS: usize = 6;
/// How many inputs ahead of the multiplied one weights are prefetched.
const AHEAD: usize = 16;

/// Computes W x + b, given the panels of W, each of `inputs` weights for one [half](HALF) and as many for the other.
#[target_feature(enable = "avx2,fma")]
pub(super) fn multiply(weights: &[Weights], inputs: usize, mut job: Job<'_, f32>) {
    let rows = job.batch.candidates * job.batch.rows;
    let blocks = rows.div_ceil(ROWS);
    for panel in 0..job.bias.len() {
        let weights = &weights[panel * inputs..][..inputs];
        let first = panel * PANEL;
        for half in (first..job.outputs.min(first + PANEL)).step_by(HALF) {
            for block in 0..blocks {
                let row = block * rows / blocks;
                let is_first = half == first;
                match (block + 1) * rows / blocks - row {
                    1 if is_first => multiply_rows::<1, 2>(weights, &mut job, half, row),
                    2 if is_first => multiply_rows::<2, 2>(weights, &mut job, half, row),
                    3 if is_first => multiply_rows::<3, 2>(weights, &mut job, half, row),
                    1..=3 => {}
                    4 => multiply_rows::<4, 1>(weights, &mut job, half, row),
                    5 => multiply_rows::<5, 1>(weights, &mut job, half, row),
                    ROWS => multiply_rows::<ROWS, 1>(weights, &mut job, half, row),
                    count => unreachable!("a block has 1 to {ROWS} rows, not {count}"),
                }
            }
        }
    }
}

/// The sums of a row for half a panel.
type Sums = [__m256; HALF / LANES];

/// `N` rows times `H` halves of a panel, from an output on.
#[inline(never)]
#[target_feature(enable = "avx2,fma")]
fn multiply_rows<const N: usize, const H: usize>(
    weights: &[Weights],
    job: &mut Job<'_, f32>,
    output: usize,
    first: usize,
) {
    let starts = job.batch.starts::<N>(first);
    let mut x = [job.x.as_ptr(); N];
    for (x, start) in x.iter_mut().zip(&starts) {
        *x = job.x[start.from..][..weights.len()].as_ptr();
    }
    assert!(output % PANEL + H * HALF <= PANEL, "halves of one panel");
    let mut halves = [weights.as_ptr().cast::<f32>(); H];
    for (i, half) in halves.iter_mut().enumerate() {
        *half = half.wrapping_add((output % PANEL + i * HALF) * weights.len());
    }
    // SAFETY: every row was just found to have a value for each input, and the halves to be of a panel with `HALF` weights.
    let sums = unsafe { add_products(halves, x, weights.len()) };
    let Bias(bias) = &job.bias[output / PANEL];
    let bias = &bias[output % PANEL..];
    let width = (job.outputs - output).min(H * HALF);
    for (start, sums) in starts.iter().zip(&sums) {
        let target = &mut job.out[start.to + output..][..width];
        finish(target, sums, bias, job.store);
    }
}

/// Each sum is one chain over the inputs in order.
///
/// # Safety
///
/// Each row of x has `inputs` values, and each half that many times [`HALF`] weights.
#[inline]
#[target_feature(enable = "avx2,fma")]
unsafe fn add_products<const N: usize, const H: usize>(
    halves: [*const f32; H],
    x: [*const f32; N],
    inputs: usize,
) -> [[Sums; H]; N] {
    let mut sums = [[[_mm256_setzero_ps(); HALF / LANES]; H]; N];
    for k in 0..inputs {
        let mut weights = [[_mm256_setzero_ps(); HALF / LANES]; H];
        for (weights, half) in weights.iter_mut().zip(halves) {
            let first = half.wrapping_add(k * HALF);
            prefetch(first.wrapping_add(AHEAD * HALF));
            // SAFETY: the caller says that there are `HALF` weights of this input.
            *weights = unsafe { [_mm256_loadu_ps(first), _mm256_loadu_ps(first.add(LANES))] };
        }
        for (sums, row) in sums.iter_mut().zip(x) {
            // SAFETY: the caller says that the row has this value.
            let value = _mm256_set1_ps(unsafe { *row.add(k) });
            for (sums, weights) in sums.iter_mut().zip(weights) {
                sums[0] = _mm256_fmadd_ps(value, weights[0], sums[0]);
                sums[1] = _mm256_fmadd_ps(value, weights[1], sums[1]);
            }
        }
    }
    sums
}

/// Writes a row's sums and the bias.
#[inline]
#[target_feature(enable = "avx2,fma")]
fn finish<const H: usize>(target: &mut [f32], sums: &[Sums; H], bias: &[f32], store: Store) {
    let mut values = [0.0; PANEL];
    let registers = sums.iter().flatten();
    for (values, sum) in values.as_chunks_mut::<LANES>().0.iter_mut().zip(registers) {
        // SAFETY: 8 values are written.
        unsafe { _mm256_storeu_ps(values.as_mut_ptr(), *sum) };
    }
    let values = values.iter().zip(bias).map(|(v, b)| v + b);
    match store {
        Store::Replace => target.iter_mut().zip(values).for_each(|(t, v)| *t = v),
        Store::Add => target.iter_mut().zip(values).for_each(|(t, v)| *t += v),
    }
}
