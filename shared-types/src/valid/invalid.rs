//! The error of validation.

use crate::PROTOCOL_VERSION;
use crate::codes::{Outcome, PlanField, UnknownCode};
use std::fmt;

/// A message that is not acceptable: which field, and why.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Invalid {
    /// The field's name in the wire message.
    pub field: &'static str,
    /// Index, from 0, of the element that is wrong, where the field is an array; `None` where the whole field is.
    pub index: Option<usize>,
    /// What is wrong with the field.
    pub reason: Reason,
}

/// What is wrong with a field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reason {
    /// NaN or infinite.
    NotFinite {
        /// The value.
        value: f64,
    },
    /// Outside its range.
    OutOfRange {
        /// The value.
        value: f64,
        /// The range allowed.
        allowed: &'static str,
    },
    /// A number of things outside its range.
    Count {
        /// The number found.
        count: u64,
        /// The least allowed.
        least: u64,
        /// The most allowed.
        most: u64,
    },
    /// A code without meaning.
    Code(UnknownCode),
    /// Neither 0 nor 1.
    NotAFlag {
        /// The value.
        value: u32,
    },
    /// A time that is not later than the one before.
    NotIncreasing {
        /// The time before it, seconds.
        previous: f64,
        /// The value, seconds.
        value: f64,
    },
    /// Another version of the protocol.
    WrongVersion {
        /// The sender's version.
        found: u32,
    },
    /// Well formed, but not served by this version.
    NotServed {
        /// What is not served.
        what: &'static str,
    },
}

impl fmt::Display for Invalid {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.field)?;
        if let Some(index) = self.index {
            write!(formatter, "[{index}]")?;
        }
        match self.reason {
            Reason::NotFinite { value } => {
                write!(formatter, " is {value}; finite numbers are allowed")
            }
            Reason::OutOfRange { value, allowed } => {
                write!(formatter, " is {value}; allowed is {allowed}")
            }
            Reason::Count { count, least, most } => {
                write!(formatter, " is {count}; allowed is {least}..={most}")
            }
            Reason::Code(code) => write!(formatter, ": {code}"),
            Reason::NotAFlag { value } => {
                write!(formatter, " is {value}; allowed are 0 (no) and 1 (yes)")
            }
            Reason::NotIncreasing { previous, value } => {
                write!(
                    formatter,
                    " is at {value} s, not later than the one before at {previous} s"
                )
            }
            Reason::WrongVersion { found } => {
                write!(
                    formatter,
                    " is {found}; this program speaks {PROTOCOL_VERSION}"
                )
            }
            Reason::NotServed { what } => {
                write!(formatter, ": {what} is not served by this version")
            }
        }
    }
}

impl std::error::Error for Invalid {}

impl Invalid {
    /// The field of a plan request that it names; none of another message.
    #[must_use]
    pub fn plan_field(&self) -> PlanField {
        PlanField::ALL
            .iter()
            .copied()
            .find(|field| field.text() == self.field)
            .unwrap_or(PlanField::None)
    }

    /// The outcome with which a daemon answers such a request.
    #[must_use]
    pub const fn outcome(&self) -> Outcome {
        match self.reason {
            Reason::WrongVersion { .. } => Outcome::WrongVersion,
            _ => Outcome::InvalidRequest,
        }
    }
}

pub(super) const fn invalid(field: &'static str, reason: Reason) -> Invalid {
    Invalid {
        field,
        index: None,
        reason,
    }
}

pub(super) const fn invalid_at(field: &'static str, index: usize, reason: Reason) -> Invalid {
    Invalid {
        field,
        index: Some(index),
        reason,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_reason_says_what_was_wrong_and_what_is_allowed() {
        let cases = [
            (
                Reason::NotFinite { value: f64::NAN },
                "x is NaN; finite numbers are allowed",
            ),
            (
                Reason::OutOfRange {
                    value: 2.0,
                    allowed: "0..=1",
                },
                "x is 2; allowed is 0..=1",
            ),
            (
                Reason::Count {
                    count: 65,
                    least: 1,
                    most: 64,
                },
                "x is 65; allowed is 1..=64",
            ),
            (
                Reason::NotAFlag { value: 2 },
                "x is 2; allowed are 0 (no) and 1 (yes)",
            ),
            (
                Reason::NotIncreasing {
                    previous: 1.0,
                    value: 0.5,
                },
                "x is at 0.5 s, not later than the one before at 1 s",
            ),
            (
                Reason::WrongVersion { found: 9 },
                "x is 9; this program speaks 7",
            ),
            (
                Reason::NotServed { what: "that" },
                "x: that is not served by this version",
            ),
        ];
        for (reason, text) in cases {
            assert_eq!(invalid("x", reason).to_string(), text);
        }
        assert_eq!(
            invalid_at(
                "balls",
                3,
                Reason::NotFinite {
                    value: f64::INFINITY
                }
            )
            .to_string(),
            "balls[3] is inf; finite numbers are allowed"
        );
    }
}
