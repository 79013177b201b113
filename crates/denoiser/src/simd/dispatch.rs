//! Runs a loop with the widest vectors that the processor has.
//!
//! A kernel is written once; [`dispatch`] compiles it for AVX-512, for AVX2 with FMA, and without either, and picks at
//! run time. The choice is the same for the whole life of the process. Why not by `fearless_simd`: decision 0025.
#![allow(unsafe_code)] // calling what is compiled for features that were detected

use super::lanes::Lanes;
use super::token::Plain;
#[cfg(target_arch = "x86_64")]
use super::token::{Avx2, Avx512};
use std::sync::LazyLock;

/// What may be used of this processor.
#[derive(Clone, Copy)]
pub(crate) enum Level {
    /// AVX-512 F, VL, DQ, BW, AVX2 and FMA.
    #[cfg(target_arch = "x86_64")]
    Avx512(Avx512),
    /// AVX2 and FMA.
    #[cfg(target_arch = "x86_64")]
    Avx2(Avx2),
    /// No vector extension.
    Plain,
}

/// Every level that this processor has, the widest first.
static DETECTED: LazyLock<Vec<Level>> = LazyLock::new(|| {
    let mut levels = vec![];
    #[cfg(target_arch = "x86_64")]
    {
        levels.extend(Avx512::detect().map(Level::Avx512));
        levels.extend(Avx2::detect().map(Level::Avx2));
    }
    levels.push(Level::Plain);
    levels
});

/// Work that is compiled for each level.
pub(crate) trait Kernel {
    /// Does the work; must be marked `#[inline(always)]` so that it takes on the caller's features.
    fn run<L: Lanes>(self, lanes: L);
}

/// The widest level that this processor has.
pub(crate) fn detected() -> Level {
    DETECTED[0]
}

/// Runs a kernel with the widest vectors available.
pub(crate) fn dispatch(kernel: impl Kernel) {
    run_at(detected(), kernel);
}

/// Runs a kernel at a level.
pub(crate) fn run_at(level: Level, kernel: impl Kernel) {
    match level {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: the level proves that AVX-512 F, VL, DQ, BW, AVX2 and FMA were detected.
        Level::Avx512(lanes) => unsafe { run_avx512(kernel, lanes) },
        #[cfg(target_arch = "x86_64")]
        // SAFETY: the level proves that AVX2 and FMA were detected.
        Level::Avx2(lanes) => unsafe { run_avx2(kernel, lanes) },
        Level::Plain => kernel.run(Plain),
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,avx2,fma")]
fn run_avx512(kernel: impl Kernel, lanes: Avx512) {
    kernel.run(lanes);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn run_avx2(kernel: impl Kernel, lanes: Avx2) {
    kernel.run(lanes);
}

/// Every level that this processor has.
#[cfg(test)]
pub(crate) fn detected_levels() -> Vec<Level> {
    DETECTED.clone()
}
