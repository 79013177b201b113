//! Running a loop with the widest vectors that the processor has.
//!
//! A kernel is written once and compiled for AVX-512, for AVX2 and for neither. No level fuses or reorders anything, so
//! the result does not depend on the processor.
#![allow(unsafe_code)] // calling what is compiled for features that were just detected

/// Work that is compiled for each level.
pub(super) trait Kernel {
    /// Does the work; must be marked `#[inline(always)]`, and so what it calls, to take on the features of a level.
    fn run(self);
}

/// Runs a kernel with the widest vectors available.
#[inline]
pub(super) fn dispatch(kernel: impl Kernel) {
    #[cfg(target_arch = "x86_64")]
    {
        if is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512dq") {
            // SAFETY: AVX-512 F and DQ were just detected.
            unsafe { run_avx512(kernel) };
            return;
        }
        if is_x86_feature_detected!("avx2") {
            // SAFETY: AVX2 was just detected.
            unsafe { run_avx2(kernel) };
            return;
        }
    }
    kernel.run();
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512dq,avx2")]
fn run_avx512(kernel: impl Kernel) {
    kernel.run();
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn run_avx2(kernel: impl Kernel) {
    kernel.run();
}
