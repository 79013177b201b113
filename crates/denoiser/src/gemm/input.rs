//! The factors of a product, in one of the number formats.

use super::bf16::Brain;

/// The factors x of a product, which decide its precision.
#[derive(Clone, Copy)]
pub enum Input<'a> {
    /// For [`Precision::Single`](super::Precision::Single).
    Single(&'a [f32]),
    /// For [`Precision::Brain`](super::Precision::Brain).
    Brain(&'a [Brain]),
    /// The same, with zeros behind each row up to [`padded`](super::padded), as [`BrainBuffer::fill_rows`](super::BrainBuffer::fill_rows) makes them: needs no copies.
    PaddedBrain(&'a [Brain]),
}

impl Input<'_> {
    /// Without its first values.
    pub(crate) fn skip(self, count: usize) -> Self {
        match self {
            Self::Single(values) => Self::Single(&values[count..]),
            Self::Brain(values) => Self::Brain(&values[count..]),
            Self::PaddedBrain(values) => Self::PaddedBrain(&values[count..]),
        }
    }
}
