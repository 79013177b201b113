//! Numbers of the page.

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use serde::{Serialize, Serializer};

/// Numbers, in the page as base64 of little-endian f32.
#[derive(Default)]
pub(super) struct Samples(pub(super) Vec<f64>);

impl Serialize for Samples {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let bytes = self
            .0
            .iter()
            .flat_map(|value| (*value as f32).to_le_bytes());
        serializer.serialize_str(&BASE64_STANDARD.encode(bytes.collect::<Vec<u8>>()))
    }
}

impl FromIterator<f64> for Samples {
    fn from_iter<I: IntoIterator<Item = f64>>(values: I) -> Self {
        Self(values.into_iter().collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_base64_of_little_endian_f32() {
        let text = serde_json::to_string(&Samples(vec![1.0, -2.5])).unwrap();
        assert_eq!(text, "\"AACAPwAAIMA=\"");
    }
}
