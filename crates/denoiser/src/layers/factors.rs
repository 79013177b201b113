//! The factors of products, rounded where the precision asks for it.

use crate::gemm::{BrainBuffer, Input, Precision};

/// In which precision products are computed, and the buffer of their rounded factors.
pub(crate) struct Factors {
    precision: Precision,
    rounded: BrainBuffer,
}

impl Default for Factors {
    fn default() -> Self {
        Self {
            precision: Precision::Single,
            rounded: BrainBuffer::default(),
        }
    }
}

impl Factors {
    pub(crate) fn set_precision(&mut self, precision: Precision) {
        self.precision = precision;
    }

    /// Values whose rows may overlap.
    pub(crate) fn of<'a>(&'a mut self, x: &'a [f32]) -> Input<'a> {
        match self.precision {
            Precision::Single => Input::Single(x),
            Precision::Brain => {
                self.rounded.fill(x);
                Input::Brain(self.rounded.values())
            }
        }
    }

    /// Rows of `width` values that lie one behind the other.
    pub(crate) fn of_rows<'a>(&'a mut self, x: &'a [f32], width: usize) -> Input<'a> {
        match self.precision {
            Precision::Single => Input::Single(x),
            Precision::Brain => {
                self.rounded.fill_rows(x, width);
                Input::PaddedBrain(self.rounded.values())
            }
        }
    }
}
