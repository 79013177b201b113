//! The parts of a processor that compute bf16 products.

#[cfg(target_arch = "x86_64")]
use super::amx_available;
#[cfg(target_arch = "x86_64")]
use std::arch::x86_64::{__cpuid, CpuidResult};
use std::sync::LazyLock;

/// Proof that this processor has AVX-512 F, BW, VL and BF16: only [`Bf16Unit::detected`] makes one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Avx512Bf16(());

/// Proof that this processor has AMX BF16 beside AVX-512 BF16, and that its tiles may be used: only [`Bf16Unit::detected`]
/// makes one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AmxBf16(());

/// A part of a processor that computes bf16 products; a value exists only for one that this processor has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bf16Unit {
    /// AVX-512 BF16: pairs of products in vector registers.
    Avx512(Avx512Bf16),
    /// AMX BF16: tiles of products.
    Amx(AmxBf16),
}

static UNITS: LazyLock<Vec<Bf16Unit>> = LazyLock::new(|| {
    let mut units = vec![];
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512vl")
        && is_x86_feature_detected!("avx512bf16")
    {
        units.push(Bf16Unit::Avx512(Avx512Bf16(())));
        if amx_available::available() {
            units.push(Bf16Unit::Amx(AmxBf16(())));
        }
    }
    units
});

impl Bf16Unit {
    /// The units of this processor, the fastest last.
    #[must_use]
    pub fn detected() -> &'static [Self] {
        &UNITS
    }

    pub(super) fn best() -> Option<Self> {
        UNITS.last().copied()
    }

    /// Whether its products take less time than those in f32: AVX-512 BF16 was measured to have twice their rate on AMD's Zen 4, and
    /// half of it on an Intel Xeon.
    pub(super) fn is_faster_than_f32(self) -> bool {
        match self {
            Self::Amx(_) => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(_) => {
                let CpuidResult { ebx, ecx, edx, .. } = __cpuid(0);
                [ebx, edx, ecx].map(u32::to_le_bytes).as_flattened() == b"AuthenticAMD"
            }
            #[cfg(not(target_arch = "x86_64"))]
            Self::Avx512(_) => false,
        }
    }

    /// The fastest unit, where products in bf16 are known to be available.
    pub(super) fn expected() -> Self {
        Self::best().expect("bf16 is available on this processor")
    }
}
