//! The validated trajectory.

use super::check::{Quantity, check_code, check_count, check_range, check_stamp, check_version};
use super::invalid::{Invalid, Reason, invalid, invalid_at};
use crate::capacity::{MAX_CANDIDATES, MAX_KNOTS};
use crate::codes::MotionStart;
use crate::message::{Knot, TrajectoryMessage};

/// A well-formed trajectory; whether it starts where the robot is and keeps its limits is for the controller to check.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    /// Id of the trajectory, at least 1.
    pub id: u32,
    /// The plan it was selected from.
    pub plan_id: u64,
    /// Index of the draw of its plan that the motion is of.
    pub draw: usize,
    /// The controller that is to execute it.
    pub controller_instance: u64,
    /// Instance of the daemon that has published the trajectory.
    pub daemon_instance: u64,
    /// When the daemon received the request for it, nanoseconds of `CLOCK_MONOTONIC`.
    pub requested_mono_ns: i64,
    /// When the motion begins, or is expected to where it leaves another one, nanoseconds of `CLOCK_MONOTONIC`.
    pub begin_mono_ns: i64,
    /// The trajectory that it leaves; none where it begins at rest.
    pub leaves: Option<Departure>,
    /// Tracking error that the certificate covers, radians.
    pub path_tolerance_rad: f64,
    /// 2..=256 knots, times from 0 and strictly increasing, all values finite.
    pub knots: Vec<Knot>,
}

/// The place at which one trajectory goes over into another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Departure {
    /// Id of the trajectory that is left, at least 1.
    pub trajectory_id: u32,
    /// Path time of that trajectory at which it is left, above 0, seconds; the path time of the other one is 0 there.
    pub path_time_s: f64,
}

impl TryFrom<&TrajectoryMessage> for Trajectory {
    type Error = Invalid;

    fn try_from(wire: &TrajectoryMessage) -> Result<Self, Invalid> {
        check_version(wire.protocol_version)?;
        let count = check_count("knot_count", wire.knot_count, 2, MAX_KNOTS)?;
        let knots = wire.knots[..count].to_vec();
        check_knots(&knots)?;
        let tolerance = check_range(
            wire.path_tolerance_rad,
            super::LEAST_PATH_TOLERANCE_RAD,
            super::MAX_ANGLE_RAD,
            "0.001..=1000 rad",
        );
        check_count("trajectory_id", wire.trajectory_id, 1, u32::MAX as usize)?;
        Ok(Self {
            id: wire.trajectory_id,
            plan_id: wire.plan_id,
            draw: check_count("draw", wire.draw, 0, MAX_CANDIDATES - 1)?,
            controller_instance: wire.controller_instance,
            daemon_instance: wire.daemon_instance,
            requested_mono_ns: check_stamp("requested_mono_ns", wire.requested_mono_ns)?,
            begin_mono_ns: check_stamp("begin_mono_ns", wire.begin_mono_ns)?,
            leaves: departure(wire)?,
            path_tolerance_rad: tolerance
                .map_err(|reason| invalid("path_tolerance_rad", reason))?,
            knots,
        })
    }
}

fn departure(wire: &TrajectoryMessage) -> Result<Option<Departure>, Invalid> {
    if check_code::<MotionStart>("start", wire.start)? == MotionStart::AtRest {
        return Ok(None);
    }
    check_count(
        "leaves_trajectory_id",
        wire.leaves_trajectory_id,
        1,
        u32::MAX as usize,
    )?;
    let (least, most) = (f64::MIN_POSITIVE, super::MAX_DURATION_S);
    check_range(wire.leaves_at_s, least, most, "above 0 to 1e6 s")
        .map_err(|reason| invalid("leaves_at_s", reason))?;
    Ok(Some(Departure {
        trajectory_id: wire.leaves_trajectory_id,
        path_time_s: wire.leaves_at_s,
    }))
}

/// Checks that times begin at 0 and strictly increase and that all values are finite and of sane magnitude.
///
/// # Errors
/// [`Invalid`] with the first knot that is wrong.
pub fn check_knots(knots: &[Knot]) -> Result<(), Invalid> {
    let mut previous = None;
    for (index, knot) in knots.iter().enumerate() {
        check_knot(knot, previous).map_err(|reason| invalid_at("knots", index, reason))?;
        previous = Some(knot.time_s);
    }
    Ok(())
}

fn check_knot(knot: &Knot, previous: Option<f64>) -> Result<(), Reason> {
    check_range(knot.time_s, 0.0, super::MAX_DURATION_S, "0..=1e6 s")?;
    match previous {
        None if knot.time_s != 0.0 => {
            return Err(Reason::OutOfRange {
                value: knot.time_s,
                allowed: "a first time of 0 s",
            });
        }
        Some(previous) if knot.time_s <= previous => {
            return Err(Reason::NotIncreasing {
                previous,
                value: knot.time_s,
            });
        }
        _ => {}
    }
    Quantity::Angle.check_all(&knot.configuration_rad)?;
    Quantity::Rate.check_all(&knot.velocity_rad_s)?;
    Quantity::Rate.check_all(&knot.acceleration_rad_s2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::PROTOCOL_VERSION;
    use crate::valid::BadCase;

    fn wire() -> TrajectoryMessage {
        let mut wire = TrajectoryMessage {
            protocol_version: PROTOCOL_VERSION,
            trajectory_id: 1,
            knot_count: 3,
            path_tolerance_rad: 0.01,
            ..TrajectoryMessage::ZEROED
        };
        for (index, knot) in wire.knots[..3].iter_mut().enumerate() {
            knot.time_s = index as f64;
        }
        wire
    }

    #[test]
    fn a_good_trajectory_is_read_and_nothing_beyond_its_count() {
        let mut wire = wire();
        wire.knots[3].time_s = f64::NAN;
        let trajectory = Trajectory::try_from(&wire).unwrap();
        assert_eq!(trajectory.knots, wire.knots[..3]);
        assert_eq!((trajectory.id, trajectory.path_tolerance_rad), (1, 0.01));
    }

    #[test]
    fn each_field_is_checked_and_named() {
        let cases: &[BadCase<TrajectoryMessage>] = &[
            (|t| t.protocol_version = 99, "protocol_version is 99"),
            (
                |t| t.trajectory_id = 0,
                "trajectory_id is 0; allowed is 1..=4294967295",
            ),
            (|t| t.knot_count = 1, "knot_count is 1; allowed is 2..=256"),
            (
                |t| t.knot_count = 257,
                "knot_count is 257; allowed is 2..=256",
            ),
            (|t| t.draw = 64, "draw is 64; allowed is 0..=63"),
            (|t| t.begin_mono_ns = i64::MIN, "begin_mono_ns is -9"),
            (
                |t| t.path_tolerance_rad = 0.0,
                "path_tolerance_rad is 0; allowed is 0.001..=1000 rad",
            ),
            (
                |t| t.path_tolerance_rad = f64::NAN,
                "path_tolerance_rad is NaN",
            ),
            (
                |t| t.knots[0].time_s = 0.5,
                "knots[0] is 0.5; allowed is a first time of 0 s",
            ),
            (|t| t.knots[0].time_s = -0.5, "knots[0] is -0.5"),
            (
                |t| t.knots[2].time_s = 1.0,
                "knots[2] is at 1 s, not later than the one before at 1 s",
            ),
            (|t| t.knots[2].time_s = 0.5, "knots[2] is at 0.5 s"),
            (|t| t.knots[1].time_s = f64::NAN, "knots[1] is NaN"),
            (|t| t.knots[2].time_s = f64::INFINITY, "knots[2] is inf"),
            (
                |t| t.knots[0].configuration_rad[5] = f64::NAN,
                "knots[0] is NaN",
            ),
            (
                |t| t.knots[1].configuration_rad[0] = 2e3,
                "knots[1] is 2000; allowed is -1000..=1000 rad",
            ),
            (
                |t| t.knots[1].velocity_rad_s[0] = f64::INFINITY,
                "knots[1] is inf",
            ),
            (
                |t| t.knots[2].acceleration_rad_s2[5] = -1e7,
                "knots[2] is -10000000; allowed is -1e6",
            ),
        ];
        for (change, text) in cases {
            let mut wire = wire();
            change(&mut wire);
            let error = Trajectory::try_from(&wire).expect_err(text);
            assert!(
                error.to_string().starts_with(text),
                "{error} does not begin with {text:?}"
            );
        }
    }
}
