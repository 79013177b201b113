//! The parts of a processor that compute bf16 products.

#[cfg(target_arch = "x86_64")]
use super::amx_available;
#[cfg(target_arch = "x86_64")]
use std::arch::x86_64::{__cpuid, CpuidResult};
use std::sync::LazyLock;

/// Proof that this processor has AVX-512 F, BW, VL and BF16: only [`Unit::detected`] makes one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bf16Vectors(());

/// Proof that this processor has AMX BF16 beside AVX-512 BF16, and that its tiles may be used: only [`Unit::detected`]
/// makes one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bf16Tiles(());

/// What computes bf16 products; there is a value only of what this processor has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// AVX-512 BF16: pairs of products in vector registers.
    Vectors(Bf16Vectors),
    /// AMX BF16: tiles of products.
    Tiles(Bf16Tiles),
}

static UNITS: LazyLock<Vec<Unit>> = LazyLock::new(|| {
    let mut units = vec![];
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512vl")
        && is_x86_feature_detected!("avx512bf16")
    {
        units.push(Unit::Vectors(Bf16Vectors(())));
        if amx_available::available() {
            units.push(Unit::Tiles(Bf16Tiles(())));
        }
    }
    units
});

impl Unit {
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
    pub(super) fn is_faster_than_single(self) -> bool {
        match self {
            Self::Tiles(_) => true,
            #[cfg(target_arch = "x86_64")]
            Self::Vectors(_) => {
                let CpuidResult { ebx, ecx, edx, .. } = __cpuid(0);
                [ebx, edx, ecx].map(u32::to_le_bytes).as_flattened() == b"AuthenticAMD"
            }
            #[cfg(not(target_arch = "x86_64"))]
            Self::Vectors(_) => false,
        }
    }

    /// The fastest unit, where products in bf16 are known to be available.
    pub(super) fn expected() -> Self {
        Self::best().expect("bf16 is available on this processor")
    }
}
