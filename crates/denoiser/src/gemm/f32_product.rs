//! f32 products.
#![allow(unsafe_code)] // calling what is compiled for features that were detected

use super::f32_panels::{F32Panels, Weights};
use super::job::{Job, PANEL};
#[cfg(target_arch = "x86_64")]
use super::{f32_avx2, f32_avx512};
use crate::simd::dispatch::Level;

/// Computes with the vectors that the matrix is packed for.
pub(super) fn multiply(panels: &F32Panels, job: Job<'_, f32>) {
    match panels.level {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: the level proves that its features were detected.
        Level::Avx512(_) => unsafe { f32_avx512::multiply(&panels.weights, panels.inputs, job) },
        #[cfg(target_arch = "x86_64")]
        // SAFETY: the level proves that its features were detected.
        Level::Avx2(_) => unsafe { f32_avx2::multiply(&panels.weights, panels.inputs, job) },
        Level::Plain => multiply_plainly(panels, job),
    }
}

/// Computes without vector extensions.
fn multiply_plainly(panels: &F32Panels, mut job: Job<'_, f32>) {
    for block in job.blocks(1) {
        let weights = &panels.weights[block.panel * panels.inputs..][..panels.inputs];
        let mut sums = [0.0; PANEL];
        for (Weights(weights), x) in weights.iter().zip(job.input(block, 0)) {
            let sums = sums.iter_mut().zip(weights);
            sums.for_each(|(sum, weight)| *sum += x * weight);
        }
        job.finish(block, 0, &sums);
    }
}
