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
pub(crate) fn f32_fma() -> Option<f64> {
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
pub(crate) fn bf16_avx512() -> Option<f64> {
    let detected = is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512bf16");
    detected.then(|| {
        // SAFETY: AVX-512 F and BF16 were just detected.
        best(CHAINS * 32, || unsafe { bf16_chains() })
    })
}

#[target_feature(enable = "avx512f,avx512bf16")]
fn bf16_chains() {
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

/// bf16 multiply-adds of AMX with four independent sums.
///
/// # Safety
///
/// The processor must have AMX BF16 and this process the permission to use it.
pub(crate) unsafe fn bf16_amx() -> f64 {
    // SAFETY: as the caller promises.
    best(4 * 16 * 16 * 32, || unsafe { tile_chains() })
}

#[repr(align(64))]
struct Configuration([u8; 64]);

/// # Safety
///
/// As for [`bf16_amx`].
unsafe fn tile_chains() {
    let mut configuration = Configuration([0; 64]);
    configuration.0[0] = 1;
    for tile in 0..8 {
        configuration.0[16 + 2 * tile] = 64;
        configuration.0[48 + tile] = 16;
    }
    // SAFETY: the configuration is a valid one of palette 1; only tiles and the counter are written.
    unsafe {
        std::arch::asm!(
            "ldtilecfg [{configuration}]",
            "2:",
            "tdpbf16ps tmm0, tmm4, tmm6",
            "tdpbf16ps tmm1, tmm4, tmm7",
            "tdpbf16ps tmm2, tmm5, tmm6",
            "tdpbf16ps tmm3, tmm5, tmm7",
            "dec {count}",
            "jnz 2b",
            "tilerelease",
            configuration = in(reg) &raw const configuration,
            count = inout(reg) LOOPS => _,
            out("tmm0") _, out("tmm1") _, out("tmm2") _, out("tmm3") _,
            out("tmm4") _, out("tmm5") _, out("tmm6") _, out("tmm7") _,
            options(nostack),
        );
    }
}
