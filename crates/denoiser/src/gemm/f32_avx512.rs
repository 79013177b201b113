//! f32 products with AVX-512.
//!
//! All sums of a block of rows stay in registers, and blocks cross from one candidate to the next. Eight inputs are
//! multiplied between two computations of addresses, and the next panel's weights are prefetched while the rows go
//! through this one's.
#![allow(unsafe_code)] // loads from slices into vector registers

use super::f32_panels::Weights;
use super::job::{Bias, Job, PANEL, Store};
use std::arch::x86_64::*;

/// Rows that fit the registers together with their weights.
const ROWS: usize = 12;
/// Inputs between two computations of addresses.
const UNROLLED: usize = 8;
/// Blocks of rows from which on a panel takes long enough to prefetch the next one without being held up.
const WORTH_PREFETCHING: usize = 4;

/// Computes W x + b, given the panels of W, each of `inputs` weights.
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512dq,avx2,fma")]
pub(super) fn multiply(weights: &[Weights], inputs: usize, mut job: Job<'_, f32>) {
    let rows = job.batch.candidates * job.batch.rows;
    let blocks = rows.div_ceil(ROWS);
    for panel in 0..job.bias.len() {
        let (now, later) = weights[panel * inputs..].split_at(inputs);
        let is_long = blocks >= WORTH_PREFETCHING;
        let later = if is_long {
            &later[..inputs.min(later.len())]
        } else {
            &[]
        };
        for block in 0..blocks {
            let share = |whole: usize| block * whole / blocks..(block + 1) * whole / blocks;
            let (first, ahead) = (share(rows).start, &later[share(later.len())]);
            match share(rows).len() {
                1 => multiply_rows::<1>(now, ahead, &mut job, panel, first),
                2 => multiply_rows::<2>(now, ahead, &mut job, panel, first),
                3 => multiply_rows::<3>(now, ahead, &mut job, panel, first),
                4 => multiply_rows::<4>(now, ahead, &mut job, panel, first),
                5 => multiply_rows::<5>(now, ahead, &mut job, panel, first),
                6 => multiply_rows::<6>(now, ahead, &mut job, panel, first),
                7 => multiply_rows::<7>(now, ahead, &mut job, panel, first),
                8 => multiply_rows::<8>(now, ahead, &mut job, panel, first),
                9 => multiply_rows::<9>(now, ahead, &mut job, panel, first),
                10 => multiply_rows::<10>(now, ahead, &mut job, panel, first),
                11 => multiply_rows::<11>(now, ahead, &mut job, panel, first),
                ROWS => multiply_rows::<ROWS>(now, ahead, &mut job, panel, first),
                count => unreachable!("a block has 1 to {ROWS} rows, not {count}"),
            }
        }
    }
}

type Sums = [__m512; 2];

/// `N` rows times one panel.
#[inline(never)]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512dq,avx2,fma")]
fn multiply_rows<const N: usize>(
    weights: &[Weights],
    ahead: &[Weights],
    job: &mut Job<'_, f32>,
    panel: usize,
    first: usize,
) {
    let starts = job.batch.starts::<N>(first);
    let mut x = [job.x.as_ptr(); N];
    for (x, start) in x.iter_mut().zip(&starts) {
        *x = job.x[start.from..][..weights.len()].as_ptr();
    }
    // SAFETY: every row was just found to have a value for each of the weights.
    let sums = unsafe { add_products(weights, ahead, x) };
    let Bias(bias) = &job.bias[panel];
    let columns = job.columns(panel);
    for (start, sums) in starts.iter().zip(&sums) {
        let target = &mut job.out[start.to + columns.start..][..columns.len()];
        finish(target, *sums, bias, job.store);
    }
}

/// Each sum is one chain over the inputs in order.
///
/// # Safety
///
/// Each row of x has a value for each of the weights.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512dq,avx2,fma")]
unsafe fn add_products<const N: usize>(
    weights: &[Weights],
    ahead: &[Weights],
    x: [*const f32; N],
) -> [Sums; N] {
    let mut sums = [[_mm512_setzero_ps(); 2]; N];
    let (chunks, last_weights) = weights.as_chunks::<UNROLLED>();
    let at_once = ahead.len().div_ceil(chunks.len().max(1)).max(1);
    let mut ahead = ahead.chunks(at_once);
    let mut k = 0;
    // SAFETY: every row has a value for each of the weights, and k counts these.
    unsafe {
        for weights in chunks {
            prefetch(ahead.next().unwrap_or(&[]));
            let [a, b, c, d, e, f, g, h] = weights;
            add_input(&mut sums, &x, k, a);
            add_input(&mut sums, &x, k + 1, b);
            add_input(&mut sums, &x, k + 2, c);
            add_input(&mut sums, &x, k + 3, d);
            add_input(&mut sums, &x, k + 4, e);
            add_input(&mut sums, &x, k + 5, f);
            add_input(&mut sums, &x, k + 6, g);
            add_input(&mut sums, &x, k + 7, h);
            k += UNROLLED;
        }
        for weights in last_weights {
            add_input(&mut sums, &x, k, weights);
            k += 1;
        }
    }
    sums
}

/// Prefetches weights into the second cache.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512dq,avx2,fma")]
fn prefetch(weights: &[Weights]) {
    for Weights(weights) in weights {
        for line in weights.as_chunks::<16>().0 {
            _mm_prefetch::<_MM_HINT_T1>(line.as_ptr().cast());
        }
    }
}

/// Adds the products of input `k` of each row.
///
/// # Safety
///
/// Each row has more than `k` values.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512dq,avx2,fma")]
unsafe fn add_input<const N: usize>(
    sums: &mut [Sums; N],
    x: &[*const f32; N],
    k: usize,
    Weights(weights): &Weights,
) {
    // SAFETY: the weights are 32 values.
    let [low, high] = unsafe {
        let first = weights.as_ptr();
        [_mm512_loadu_ps(first), _mm512_loadu_ps(first.add(16))]
    };
    for (sums, row) in sums.iter_mut().zip(x) {
        // SAFETY: the caller says that the row has this value.
        let value = _mm512_set1_ps(unsafe { *row.add(k) });
        sums[0] = _mm512_fmadd_ps(value, low, sums[0]);
        sums[1] = _mm512_fmadd_ps(value, high, sums[1]);
    }
}

/// Writes a row's sums and the bias.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512dq,avx2,fma")]
fn finish(target: &mut [f32], sums: Sums, bias: &[f32; PANEL], store: Store) {
    // one bit for each output that there is
    let all = u32::MAX >> (PANEL - target.len());
    for (half, sum) in sums.into_iter().enumerate() {
        let mask = (all >> (16 * half)) as u16;
        // SAFETY: only values of the target are touched; the bias has 32 values.
        unsafe {
            let at = target.as_mut_ptr().wrapping_add(16 * half);
            let mut sum = _mm512_add_ps(sum, _mm512_loadu_ps(bias.as_ptr().add(16 * half)));
            if store == Store::Add {
                sum = _mm512_add_ps(_mm512_maskz_loadu_ps(mask, at), sum);
            }
            _mm512_mask_storeu_ps(at, mask, sum);
        }
    }
}
