//! One way to run a loop with the widest vectors that the processor has.
//!
//! A kernel is written once as a plain loop; [`dispatch`] compiles it for AVX-512, for AVX2 with FMA, and without
//! either, and picks at run time. The choice is the same for the whole life of the process.
#![allow(unsafe_code)] // calling a function compiled for features that were just detected

use std::sync::LazyLock;

/// What a kernel may know of the processor it runs on.
pub(crate) trait Level {
    /// Whether multiply-adds are fused in hardware.
    const FUSED: bool;
    /// Rows of 32 sums that fit the registers together.
    const ROWS: usize;
}

struct Avx512;
struct Avx2;
/// No vector extension at all.
pub(crate) struct Plain;

impl Level for Avx512 {
    const FUSED: bool = true;
    const ROWS: usize = 12;
}

impl Level for Avx2 {
    const FUSED: bool = true;
    const ROWS: usize = 3;
}

impl Level for Plain {
    const FUSED: bool = false;
    const ROWS: usize = 1;
}

#[derive(Clone, Copy)]
enum Detected {
    #[cfg(target_arch = "x86_64")]
    Avx512,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    Plain,
}

static DETECTED: LazyLock<Detected> = LazyLock::new(|| {
    #[cfg(target_arch = "x86_64")]
    {
        let avx512 = is_x86_feature_detected!("avx512f")
            && is_x86_feature_detected!("avx512vl")
            && is_x86_feature_detected!("avx512dq")
            && is_x86_feature_detected!("avx512bw");
        if avx512 && is_x86_feature_detected!("fma") {
            return Detected::Avx512;
        }
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
            return Detected::Avx2;
        }
    }
    Detected::Plain
});

/// A loop that is compiled for each level.
pub(crate) trait Kernel {
    /// Does the work; must be marked `#[inline(always)]` so that it takes on the caller's features.
    fn run<L: Level>(self);
}

/// a·b + c, fused where the hardware does it.
#[inline(always)]
pub(crate) fn multiply_add<L: Level>(a: f32, b: f32, c: f32) -> f32 {
    if L::FUSED { a.mul_add(b, c) } else { a * b + c }
}

/// Runs a kernel with the widest vectors available.
pub(crate) fn dispatch(kernel: impl Kernel) {
    match *DETECTED {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: this level is chosen only after AVX-512 F, VL, DQ, BW and FMA were detected.
        Detected::Avx512 => unsafe { run_avx512(kernel) },
        #[cfg(target_arch = "x86_64")]
        // SAFETY: this level is chosen only after AVX2 and FMA were detected.
        Detected::Avx2 => unsafe { run_avx2(kernel) },
        Detected::Plain => kernel.run::<Plain>(),
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,avx2,fma")]
fn run_avx512(kernel: impl Kernel) {
    kernel.run::<Avx512>();
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn run_avx2(kernel: impl Kernel) {
    kernel.run::<Avx2>();
}
