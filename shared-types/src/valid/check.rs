//! Checks of single fields, whatever the message.

use super::invalid::{Invalid, Reason, invalid, invalid_at};
use crate::PROTOCOL_VERSION;
use crate::codes::UnknownCode;

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

pub(super) fn check_version(found: u32) -> Result<(), Invalid> {
    match found {
        PROTOCOL_VERSION => Ok(()),
        found => Err(invalid("protocol_version", Reason::WrongVersion { found })),
    }
}

/// The robot that a message is for, if it says.
pub(super) fn named_robot(robot_hash: u64) -> Option<u64> {
    (robot_hash != 0).then_some(robot_hash)
}

pub(super) fn check_count(
    field: &'static str,
    count: u32,
    least: usize,
    most: usize,
) -> Result<usize, Invalid> {
    check_within(u64::from(count), least as u64, most as u64)
        .map(|count| count as usize)
        .map_err(|reason| invalid(field, reason))
}

/// A number of things in a range, both ends included.
pub(super) fn check_within(count: u64, least: u64, most: u64) -> Result<u64, Reason> {
    if (least..=most).contains(&count) {
        Ok(count)
    } else {
        Err(Reason::Count { count, least, most })
    }
}

pub(super) fn check_flag(field: &'static str, value: u32) -> Result<bool, Invalid> {
    match value {
        0 => Ok(false),
        1 => Ok(true),
        value => Err(invalid(field, Reason::NotAFlag { value })),
    }
}

pub(super) fn check_code<T: TryFrom<u32, Error = UnknownCode>>(
    field: &'static str,
    code: u32,
) -> Result<T, Invalid> {
    T::try_from(code).map_err(|error| invalid(field, Reason::Code(error)))
}

/// A value in a range, both ends included; the text is the range.
pub(super) fn check_range(
    value: f64,
    least: f64,
    most: f64,
    allowed: &'static str,
) -> Result<f64, Reason> {
    if !value.is_finite() {
        Err(Reason::NotFinite { value })
    } else if (least..=most).contains(&value) {
        Ok(value)
    } else {
        Err(Reason::OutOfRange { value, allowed })
    }
}

/// A share of the tendon limits.
pub(super) fn check_limits_scale(scale: f64) -> Result<f64, Invalid> {
    check_range(scale, LEAST_LIMITS_SCALE, 1.0, "1e-9..=1")
        .map_err(|reason| invalid("limits_scale", reason))
}

/// A time on a trajectory, or its duration.
pub(super) fn check_time(field: &'static str, value: f64) -> Result<(), Invalid> {
    check_range(value, 0.0, MAX_DURATION_S, "0..=1e6 s")
        .map(drop)
        .map_err(|reason| invalid(field, reason))
}

/// A quantity whose magnitude is limited only so that arithmetic on it stays finite.
#[derive(Clone, Copy)]
pub(super) enum Quantity {
    Length,
    Angle,
    Rate,
}

impl Quantity {
    pub(super) fn check(self, value: f64) -> Result<f64, Reason> {
        let (most, allowed) = match self {
            Self::Length => (MAX_LENGTH_M, "-1000..=1000 m"),
            Self::Angle => (MAX_ANGLE_RAD, "-1000..=1000 rad"),
            Self::Rate => (MAX_RATE, "-1e6..=1e6 per s or s²"),
        };
        check_range(value, -most, most, allowed)
    }

    /// The first value that is not acceptable.
    pub(super) fn check_all(self, values: &[f64]) -> Result<(), Reason> {
        let mut values = values.iter();
        values.try_for_each(|&value| self.check(value).map(drop))
    }
}

/// A length that is not negative.
pub(super) fn check_distance(value: f64) -> Result<f64, Reason> {
    check_range(value, 0.0, MAX_LENGTH_M, "0..=1000 m")
}

pub(super) fn check_radius(value: f64) -> Result<f64, Reason> {
    check_range(value, 0.0, MAX_LENGTH_M, "a radius of 0..=1000 m")
}

pub(super) fn check_array(
    field: &'static str,
    values: &[f64],
    quantity: Quantity,
) -> Result<(), Invalid> {
    for (index, &value) in values.iter().enumerate() {
        quantity
            .check(value)
            .map_err(|reason| invalid_at(field, index, reason))?;
    }
    Ok(())
}

/// A stamp of `CLOCK_MONOTONIC`, which is never negative.
pub(super) fn check_stamp(field: &'static str, stamp_mono_ns: i64) -> Result<i64, Invalid> {
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

/// A stamp that need not be told; 0: it is not.
pub(super) fn check_optional_stamp(
    field: &'static str,
    stamp_mono_ns: i64,
) -> Result<Option<i64>, Invalid> {
    Ok(Some(check_stamp(field, stamp_mono_ns)?).filter(|&stamp| stamp != 0))
}

#[cfg(test)]
mod tests {
    use super::*;

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
