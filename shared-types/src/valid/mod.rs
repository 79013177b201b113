//! The validated twin of each message: made by `TryFrom`, which rejects what is wrong, says what would be allowed, and
//! never clamps.
//!
//! Checked here is what needs no robot: versions, counts, codes, finiteness, magnitudes that arithmetic survives, order
//! of times. Whether a robot can bend that far is the daemon's business. Fields that a message does not use (the goal
//! configuration of a tip goal, array elements beyond the count) are not read.
//! Copy a message out of shared memory first: another process could change it after the check.

mod command;
mod plan;
mod plan_wire;
mod report;
mod scene;
mod state;
mod trajectory;

pub use command::{Command, CommandReply};
pub use plan::{Goal, PlanRequest, PreviousPlan, SelectionRule};
pub use report::PlanReport;
pub use scene::{Heartbeat, MOST_SCENE_LIFETIME_NS, Scene, SceneStatus, SourceName, stamp_refusal};
pub use state::{ControllerState, Cycle, RobotState, Setpoint};
pub use trajectory::{Trajectory, check_knots};

use std::fmt;

use crate::PROTOCOL_VERSION;
use crate::codes::{Outcome, PlanField, UnknownCode};

/// Least tracking error that a trajectory must allow, rad: under it the noise of measurement alone would stop every motion.
pub const LEAST_PATH_TOLERANCE_RAD: f64 = 1e-3;

/// Largest magnitude of a length, metres.
pub const MAX_LENGTH_M: f64 = 1e3;
/// Largest magnitude of an angle, radians.
pub const MAX_ANGLE_RAD: f64 = 1e3;
/// Largest magnitude of a velocity or an acceleration, per s or s².
pub const MAX_RATE: f64 = 1e6;
/// Least share of the tendon limits that a plan may ask for: with less, every motion takes longer than the longest one.
pub const LEAST_LIMITS_SCALE: f64 = 1e-9;
/// Longest motion, s.
pub const MAX_DURATION_S: f64 = 1e6;

/// A message that is not acceptable: which field, and why.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Invalid {
    /// The field's name in the wire message.
    pub field: &'static str,
    /// Which element, if the field is an array.
    pub index: Option<usize>,
    /// What is wrong with it.
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
        /// The range.
        allowed: &'static str,
    },
    /// A number of things outside its range.
    Count {
        /// The number.
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
        /// The one before, seconds.
        previous: f64,
        /// The value, seconds.
        value: f64,
    },
    /// Another version of the protocol.
    WrongVersion {
        /// The sender's.
        found: u32,
    },
    /// Well formed, but not served by this version.
    NotServed {
        /// What is not.
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

    /// How a daemon answers a request that is wrong in this way.
    #[must_use]
    pub const fn outcome(&self) -> Outcome {
        match self.reason {
            Reason::WrongVersion { .. } => Outcome::WrongVersion,
            _ => Outcome::InvalidRequest,
        }
    }
}

const fn invalid(field: &'static str, reason: Reason) -> Invalid {
    Invalid {
        field,
        index: None,
        reason,
    }
}

const fn invalid_at(field: &'static str, index: usize, reason: Reason) -> Invalid {
    Invalid {
        field,
        index: Some(index),
        reason,
    }
}

fn check_version(found: u32) -> Result<(), Invalid> {
    match found {
        PROTOCOL_VERSION => Ok(()),
        found => Err(invalid("protocol_version", Reason::WrongVersion { found })),
    }
}

fn check_count(
    field: &'static str,
    count: u32,
    least: usize,
    most: usize,
) -> Result<usize, Invalid> {
    let (least, most, count) = (least as u64, most as u64, u64::from(count));
    if (least..=most).contains(&count) {
        Ok(count as usize)
    } else {
        Err(invalid(field, Reason::Count { count, least, most }))
    }
}

fn check_flag(field: &'static str, value: u32) -> Result<bool, Invalid> {
    match value {
        0 => Ok(false),
        1 => Ok(true),
        value => Err(invalid(field, Reason::NotAFlag { value })),
    }
}

fn check_code<T: TryFrom<u32, Error = UnknownCode>>(
    field: &'static str,
    code: u32,
) -> Result<T, Invalid> {
    T::try_from(code).map_err(|error| invalid(field, Reason::Code(error)))
}

/// A value in a range, both ends included; the text is the range.
fn check_range(value: f64, least: f64, most: f64, allowed: &'static str) -> Result<f64, Reason> {
    if !value.is_finite() {
        Err(Reason::NotFinite { value })
    } else if (least..=most).contains(&value) {
        Ok(value)
    } else {
        Err(Reason::OutOfRange { value, allowed })
    }
}

/// A quantity whose magnitude is limited only so that arithmetic on it stays finite.
#[derive(Clone, Copy)]
enum Quantity {
    Length,
    Angle,
    Rate,
}

impl Quantity {
    fn check(self, value: f64) -> Result<f64, Reason> {
        let (most, allowed) = match self {
            Self::Length => (MAX_LENGTH_M, "-1000..=1000 m"),
            Self::Angle => (MAX_ANGLE_RAD, "-1000..=1000 rad"),
            Self::Rate => (MAX_RATE, "-1e6..=1e6 per s or s²"),
        };
        check_range(value, -most, most, allowed)
    }
}

/// A length that is not negative.
fn check_distance(value: f64) -> Result<f64, Reason> {
    check_range(value, 0.0, MAX_LENGTH_M, "0..=1000 m")
}

fn check_radius(value: f64) -> Result<f64, Reason> {
    check_range(value, 0.0, MAX_LENGTH_M, "a radius of 0..=1000 m")
}

fn check_array(field: &'static str, values: &[f64], quantity: Quantity) -> Result<(), Invalid> {
    for (index, &value) in values.iter().enumerate() {
        quantity
            .check(value)
            .map_err(|reason| invalid_at(field, index, reason))?;
    }
    Ok(())
}

/// A stamp of `CLOCK_MONOTONIC`, which is never negative.
fn check_stamp(field: &'static str, stamp_mono_ns: i64) -> Result<i64, Invalid> {
    if stamp_mono_ns < 0 {
        let value = stamp_mono_ns as f64;
        return Err(invalid(
            field,
            Reason::OutOfRange {
                value,
                allowed: "0 or later",
            },
        ));
    }
    Ok(stamp_mono_ns)
}

/// A change to a good message, and how the error that it must cause begins.
#[cfg(test)]
type BadCase<W> = (fn(&mut W), &'static str);

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
                "x is 9; this program speaks 3",
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

    #[test]
    fn magnitudes_stop_where_their_texts_say() {
        for (quantity, most) in [
            (Quantity::Length, 1e3),
            (Quantity::Angle, 1e3),
            (Quantity::Rate, 1e6),
        ] {
            assert_eq!(quantity.check(most), Ok(most));
            assert_eq!(quantity.check(-most), Ok(-most));
            assert!(matches!(
                quantity.check(most * 1.001),
                Err(Reason::OutOfRange { .. })
            ));
            assert!(matches!(
                quantity.check(f64::NEG_INFINITY),
                Err(Reason::NotFinite { .. })
            ));
        }
    }
}
