//! The factors of products, rounded where the precision asks for it.

use crate::gemm::{Bf16Buffer, Input, Precision};

/// In which precision products are computed, and the buffer of their rounded factors.
pub(crate) struct Factors {
    precision: Precision,
    rounded: Bf16Buffer,
}

impl Default for Factors {
    fn default() -> Self {
        Self {
            precision: Precision::F32,
            rounded: Bf16Buffer::default(),
        }
    }
}

impl Factors {
    pub(crate) fn set_precision(&mut self, precision: Precision) {
        self.precision = precision;
    }

    /// `x` as the factor of a product, rounded to bf16 where that is the precision; not padded, so that rows may overlap as in a
    /// convolution.
    pub(crate) fn of<'a>(&'a mut self, x: &'a [f32]) -> Input<'a> {
        match self.precision {
            Precision::F32 => Input::F32(x),
            Precision::Bf16 => {
                self.rounded.fill(x);
                Input::Bf16(self.rounded.values())
            }
        }
    }

    /// `x`, rows of `width` values one behind the other, as the factor of a product; rounded to bf16, each row padded, where that is the
    /// precision.
    pub(crate) fn of_rows<'a>(&'a mut self, x: &'a [f32], width: usize) -> Input<'a> {
        match self.precision {
            Precision::F32 => Input::F32(x),
            Precision::Bf16 => {
                self.rounded.fill_rows(x, width);
                Input::PaddedBf16(self.rounded.values())
            }
        }
    }
}
