//! The number format of the factors of a product.

use super::bf16_unit::Bf16Unit;
use serde::Deserialize;
use std::fmt;

/// The number format of the factors of a product; sums are always f32.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
pub enum Precision {
    /// f32: 24 significant bits.
    F32,
    /// bf16: the range of f32 with 8 significant bits.
    Bf16,
}

impl fmt::Display for Precision {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::F32 => "f32",
            Self::Bf16 => "bf16",
        })
    }
}

impl Precision {
    /// Whether this processor computes in this precision: [`Precision::Bf16`] needs AVX-512 BF16.
    #[must_use]
    pub fn available(self) -> bool {
        match self {
            Self::F32 => true,
            Self::Bf16 => Bf16Unit::best().is_some(),
        }
    }

    /// The precision with the fastest products on this processor (decision 0009).
    pub(crate) fn fastest() -> Self {
        match Bf16Unit::best() {
            Some(unit) if unit.is_faster_than_f32() => Self::Bf16,
            Some(_) | None => Self::F32,
        }
    }
}
