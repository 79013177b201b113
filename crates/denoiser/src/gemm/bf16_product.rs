//! bf16 products: factors of 8 significant bits, sums in f32.
#![allow(unsafe_code)] // calling what is compiled for features that were detected

use super::bf16::Bf16;
use super::bf16_panels::Bf16Panels;
use super::bf16_unit::Bf16Unit;
use super::job::Job;
#[cfg(target_arch = "x86_64")]
use super::{bf16_amx, bf16_avx512};

/// Computes with a unit.
pub(super) fn multiply(panels: &Bf16Panels, unit: Bf16Unit, job: Job<'_, Bf16>) {
    match unit {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: the unit proves that AVX-512 F, BW, VL and BF16 were detected.
        Bf16Unit::Avx512(_) => unsafe { bf16_avx512::multiply(panels, job) },
        #[cfg(target_arch = "x86_64")]
        // SAFETY: the unit proves that tiles are available.
        Bf16Unit::Amx(_) => unsafe { bf16_amx::multiply(panels, job) },
        #[cfg(not(target_arch = "x86_64"))]
        unit => unreachable!("{unit:?} is of x86-64, not for {} rows", job.batch.rows),
    }
}
