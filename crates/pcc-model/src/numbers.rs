//! Arrays of numbers in configuration files.

use serde::de::{Deserialize, Deserializer, Error, SeqAccess, Visitor};
use std::fmt;

/// Exactly `N` numbers of a TOML file.
///
/// serde's own arrays take the first `N` values of a longer TOML array and drop the others without a word.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Numbers<const N: usize>(pub [f64; N]);

impl<'de, const N: usize> Deserialize<'de> for Numbers<N> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_seq(Exactly)
    }
}

struct Exactly<const N: usize>;

impl<'de, const N: usize> Visitor<'de> for Exactly<N> {
    type Value = Numbers<N>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "an array of exactly {N} numbers")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut values: A) -> Result<Numbers<N>, A::Error> {
        let mut numbers = [0.0; N];
        for (index, number) in numbers.iter_mut().enumerate() {
            let next = values.next_element()?;
            *number = next.ok_or_else(|| A::Error::invalid_length(index, &self))?;
        }
        let mut count = N;
        while values.next_element::<f64>()?.is_some() {
            count += 1;
        }
        if count > N {
            return Err(A::Error::invalid_length(count, &self));
        }
        Ok(Numbers(numbers))
    }
}
