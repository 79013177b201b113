//! What one core can do at most: multiply-adds between registers, without any memory.
#![allow(unsafe_code)] // vector and tile instructions

use std::arch::x86_64::*;
use std::time::Instant;

/// Independent sums: enough to hide the latency of a multiply-add on two ports.
const CHAINS: usize = 24;
const LOOPS: usize = 200_000;
const REPEATS: usize = 20;

/// The best of several runs, in 10⁹ multiply-adds a second.
fn best(products_per_loop: usize, run: impl Fn()) -> f64 {
    let seconds = |()| {
        let start = Instant::now();
        run();
        start.elapsed().as_secs_f64()
    };
    let fastest = (0..REPEATS).map(|_| seconds(())).fold(f64::MAX, f64::min);
    (LOOPS * products_per_loop) as f64 / fastest / 1e9
}

/// f32 multiply-adds of AVX-512; nothing without it.
pub(crate) fn single() -> Option<f64> {
    is_x86_feature_detected!("avx512f").then(|| {
        // SAFETY: AVX-512 F was just detected.
        best(CHAINS * 16, || unsafe { single_chains() })
    })
}

#[target_feature(enable = "avx512f")]
fn single_chains() {
    let factor = std::hint::black_box(_mm512_set1_ps(0.5));
    let mut sums = [_mm512_setzero_ps(); CHAINS];
    for _ in 0..LOOPS {
        for sum in &mut sums {
            *sum = _mm512_fmadd_ps(factor, factor, *sum);
        }
    }
    std::hint::black_box(sums);
}

/// bf16 multiply-adds of AVX-512 BF16; nothing without it.
pub(crate) fn brain_vectors() -> Option<f64> {
    let detected = is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512bf16");
    detected.then(|| {
        // SAFETY: AVX-512 F and BF16 were just detected.
        best(CHAINS * 32, || unsafe { brain_chains() })
    })
}

#[target_feature(enable = "avx512f,avx512bf16")]
fn brain_chains() {
    let pairs = std::hint::black_box(_mm512_set1_epi32(0x3f00_3f00));
    // SAFETY: both are 512 bits without invalid patterns.
    let pairs = unsafe { std::mem::transmute::<__m512i, __m512bh>(pairs) };
    let mut sums = [_mm512_setzero_ps(); CHAINS];
    for _ in 0..LOOPS {
        for sum in &mut sums {
            *sum = _mm512_dpbf16_ps(*sum, pairs, pairs);
        }
    }
    std::hint::black_box(sums);
}
