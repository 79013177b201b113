//! Hashes of numbers by their bits.

/// The `FxHash` of rustc (rotate by 5, exclusive or, multiply) over the bits of numbers, one after the other. The rotation keeps two changed
/// signs from cancelling.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BitHash(u64);

impl BitHash {
    /// Of no number.
    #[must_use]
    pub const fn new() -> Self {
        Self(0)
    }

    /// Adds a number.
    pub fn add(&mut self, bits: u64) {
        self.0 = (self.0.rotate_left(5) ^ bits).wrapping_mul(0x517c_c1b7_2722_0a95);
    }

    /// The hash of what was added.
    #[must_use]
    pub const fn value(self) -> u64 {
        self.0
    }
}
