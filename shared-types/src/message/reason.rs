//! The text beside a code.

use std::borrow::Cow;
use std::fmt::{self, Display, Formatter};

use iceoryx2::prelude::ZeroCopySend;

use super::wire::wire_message;
use crate::capacity::REASON_BYTES;

wire_message! {
    /// A UTF-8 text that says for people why something is as a code beside it says; empty where there is no more to say.
    pub struct ReasonText: "pcc.v7.ReasonText", 168 bytes {
        /// Bytes of `utf8` in use.
        pub length: u32,
        /// The text.
        pub utf8: [u8; REASON_BYTES],
    }
}

/// Writes a text, cut at the last whole character that fits; returns its bytes.
pub(super) fn write_text(text: &str, to: &mut [u8]) -> usize {
    let mut length = text.len().min(to.len());
    while !text.is_char_boundary(length) {
        length -= 1;
    }
    to[..length].copy_from_slice(&text.as_bytes()[..length]);
    length
}

impl ReasonText {
    /// The text, cut at the last whole character that fits.
    #[must_use]
    pub fn new(text: &str) -> Self {
        let mut reason = Self::ZEROED;
        reason.length = write_text(text, &mut reason.utf8) as u32;
        reason
    }

    /// The text; bytes that are no UTF-8 are replaced, lengths beyond the array are cut.
    #[must_use]
    pub fn text(&self) -> Cow<'_, str> {
        let length = (self.length as usize).min(REASON_BYTES);
        String::from_utf8_lossy(&self.utf8[..length])
    }

    /// Writes what it is the reason for, and the text behind that where there is one.
    pub(crate) fn write_after(
        &self,
        what: &dyn Display,
        formatter: &mut Formatter<'_>,
    ) -> fmt::Result {
        what.fmt(formatter)?;
        match self.text().as_ref() {
            "" => Ok(()),
            reason => write!(formatter, ": {reason}"),
        }
    }
}

impl Display for ReasonText {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        formatter.pad(&self.text())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_reason_is_cut_between_characters() {
        let text = "ζ".repeat(REASON_BYTES);
        assert!(text.len() > REASON_BYTES);
        let whole = "ζ".repeat((REASON_BYTES - 1) / 2);
        let reason = ReasonText::new(&format!("a{text}"));
        assert_eq!(reason.text(), format!("a{whole}"));
        assert_eq!(ReasonText::new("short").to_string(), "short");
    }

    #[test]
    fn a_reason_of_any_bytes_and_any_length_is_readable() {
        let reason = ReasonText {
            length: u32::MAX,
            utf8: [0xff; REASON_BYTES],
        };
        let replaced = |character| character == '\u{fffd}';
        assert!(reason.text().chars().all(replaced));
    }
}
