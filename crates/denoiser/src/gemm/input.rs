//! The factors of a product, in one of the number formats.

use super::bf16::Bf16;

/// The factors x of a product, which decide its precision.
#[derive(Clone, Copy)]
pub enum Input<'a> {
    /// For [`Precision::F32`](super::Precision::F32).
    F32(&'a [f32]),
    /// For [`Precision::Bf16`](super::Precision::Bf16).
    Bf16(&'a [Bf16]),
    /// For [`Precision::Bf16`](super::Precision::Bf16), each row with zeros behind it up to [`padded`](super::padded), as
    /// [`Bf16Buffer::fill_rows`](super::Bf16Buffer::fill_rows) makes it; multiplied without being copied.
    PaddedBf16(&'a [Bf16]),
}

impl Input<'_> {
    /// Without its first values.
    pub(crate) fn skip(self, count: usize) -> Self {
        match self {
            Self::F32(values) => Self::F32(&values[count..]),
            Self::Bf16(values) => Self::Bf16(&values[count..]),
            Self::PaddedBf16(values) => Self::PaddedBf16(&values[count..]),
        }
    }
}
