//! bf16 products with AVX-512 BF16.
//!
//! Every output is one chain over the pairs of inputs in order. The instruction itself rounds after each product and
//! takes subnormal numbers for zero.
#![allow(unsafe_code)] // loads from slices into vector registers

use super::bf16::Bf16;
use super::bf16_panels::{Bf16Panels, PairWeights};
use super::job::{Block, Job, PANEL};
use std::arch::x86_64::*;

/// Rows that fit the registers together with their weights.
const ROWS: usize = 12;

#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512bf16")]
pub(super) fn multiply(panels: &Bf16Panels, mut job: Job<'_, Bf16>) {
    for block in job.blocks(ROWS) {
        let weights = panels.panel(block.panel);
        match block.rows {
            1 => rows::<1>(weights, &mut job, block),
            2 => rows::<2>(weights, &mut job, block),
            3 => rows::<3>(weights, &mut job, block),
            4 => rows::<4>(weights, &mut job, block),
            5 => rows::<5>(weights, &mut job, block),
            6 => rows::<6>(weights, &mut job, block),
            7 => rows::<7>(weights, &mut job, block),
            8 => rows::<8>(weights, &mut job, block),
            9 => rows::<9>(weights, &mut job, block),
            10 => rows::<10>(weights, &mut job, block),
            11 => rows::<11>(weights, &mut job, block),
            ROWS => rows::<ROWS>(weights, &mut job, block),
            count => unreachable!("a block has 1 to {ROWS} rows, not {count}"),
        }
    }
}

/// `N` rows times one panel.
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512bf16")]
fn rows<const N: usize>(weights: &[PairWeights], job: &mut Job<'_, Bf16>, block: Block) {
    let inputs = job.inputs;
    let rows: [&[Bf16]; N] = std::array::from_fn(|r| job.input(block, r));
    let pairs = rows.map(|row| &row.as_chunks::<2>().0[..inputs / 2]);
    let mut sums = [[_mm512_setzero_ps(); 2]; N];
    for (k, weights) in weights[..inputs / 2].iter().enumerate() {
        add_products(&mut sums, weights, |r| pairs[r][k]);
    }
    if inputs % 2 == 1 {
        let last = &weights[inputs / 2];
        add_products(&mut sums, last, |r| [rows[r][inputs - 1], Bf16(0)]);
    }
    for (r, sums) in sums.iter().enumerate() {
        let mut values = [0.0; PANEL];
        // SAFETY: the two stores fill the two halves of 16 values.
        unsafe {
            _mm512_storeu_ps(values.as_mut_ptr(), sums[0]);
            _mm512_storeu_ps(values.as_mut_ptr().add(16), sums[1]);
        }
        job.finish(block, r, &values);
    }
}

/// Adds the products of a pair of inputs of each row with its weights.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512bf16")]
fn add_products<const N: usize>(
    sums: &mut [[__m512; 2]; N],
    weights: &PairWeights,
    pair: impl Fn(usize) -> [Bf16; 2],
) {
    let first = weights.0.as_ptr();
    // SAFETY: the weights are 32 pairs of 32 bits, read as two registers of 16; any bits are valid in both types.
    let weights = [0, 16].map(|half| unsafe {
        std::mem::transmute::<__m512i, __m512bh>(_mm512_loadu_si512(first.add(half).cast()))
    });
    for (r, sums) in sums.iter_mut().enumerate() {
        let [low, high] = pair(r).map(|value| u32::from(value.0));
        let pair = _mm512_set1_epi32((low | high << 16).cast_signed());
        // SAFETY: any bits are valid in both types.
        let pair = unsafe { std::mem::transmute::<__m512i, __m512bh>(pair) };
        for (sum, weights) in sums.iter_mut().zip(weights) {
            *sum = _mm512_dpbf16_ps(*sum, weights, pair);
        }
    }
}
