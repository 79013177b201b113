//! One way to run a loop with the widest vectors that the processor has.
//!
//! A kernel is written once; [`dispatch`] compiles it for AVX-512, for AVX2 with FMA, and without either, and picks at
//! run time. The choice is the same for the whole life of the process.
#![allow(unsafe_code)] // vector instructions, and calling what is compiled for features that were just detected

use crate::lanes::Lanes;
#[cfg(target_arch = "x86_64")]
use std::arch::x86_64::*;
use std::sync::LazyLock;

/// No vector extension.
pub(crate) struct Plain;

/// AVX2 and FMA.
#[cfg(target_arch = "x86_64")]
pub(crate) struct Avx2;

/// AVX-512 F, VL, DQ and BW.
#[cfg(target_arch = "x86_64")]
pub(crate) struct Avx512;

/// A level that this processor has: only this module makes one, after it detected the features.
#[derive(Clone, Copy)]
pub(crate) struct Detected(Features);

/// What a level may use of the processor.
#[derive(Clone, Copy)]
pub(crate) enum Features {
    /// AVX-512 F, VL, DQ, BW, AVX2 and FMA.
    #[cfg(target_arch = "x86_64")]
    Avx512,
    /// AVX2 and FMA.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// No vector extension.
    Plain,
}

impl Detected {
    /// What was detected.
    pub(crate) fn features(self) -> Features {
        self.0
    }
}

static DETECTED: LazyLock<Detected> = LazyLock::new(|| {
    #[cfg(target_arch = "x86_64")]
    {
        let avx2 = is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
        let avx512 = is_x86_feature_detected!("avx512f")
            && is_x86_feature_detected!("avx512vl")
            && is_x86_feature_detected!("avx512dq")
            && is_x86_feature_detected!("avx512bw");
        match (avx512, avx2) {
            (true, true) => return Detected(Features::Avx512),
            (false, true) => return Detected(Features::Avx2),
            (_, false) => {}
        }
    }
    Detected(Features::Plain)
});

/// Work that is compiled for each level.
pub(crate) trait Kernel {
    /// Does the work; must be marked `#[inline(always)]` so that it takes on the caller's features.
    fn run<L: Lanes>(self);
}

/// Asks the first cache for the line of an address, which need not be valid.
#[inline(always)]
pub(crate) fn ask_for(address: *const f32) {
    #[cfg(target_arch = "x86_64")]
    // SAFETY: asking has no effect but on time, whatever the address, and every x86-64 processor can.
    unsafe {
        _mm_prefetch::<_MM_HINT_T0>(address.cast());
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = address;
}

/// The widest level that this processor has.
pub(crate) fn detected() -> Detected {
    *DETECTED
}

/// Runs a kernel with the widest vectors available.
pub(crate) fn dispatch(kernel: impl Kernel) {
    run_at(detected(), kernel);
}

/// Runs a kernel at a level that was detected.
pub(crate) fn run_at(level: Detected, kernel: impl Kernel) {
    match level.0 {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: this level is chosen only after AVX-512 F, VL, DQ, BW, AVX2 and FMA were detected.
        Features::Avx512 => unsafe { run_avx512(kernel) },
        #[cfg(target_arch = "x86_64")]
        // SAFETY: this level is chosen only after AVX2 and FMA were detected.
        Features::Avx2 => unsafe { run_avx2(kernel) },
        Features::Plain => kernel.run::<Plain>(),
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

/// Every level that this processor has.
#[cfg(test)]
pub(crate) fn detected_levels() -> Vec<Detected> {
    let features = match DETECTED.0 {
        #[cfg(target_arch = "x86_64")]
        Features::Avx512 => vec![Features::Avx512, Features::Avx2, Features::Plain],
        #[cfg(target_arch = "x86_64")]
        Features::Avx2 => vec![Features::Avx2, Features::Plain],
        Features::Plain => vec![Features::Plain],
    };
    features.into_iter().map(Detected).collect()
}
