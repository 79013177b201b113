//! The goal that stays, and what becomes of it.

use std::fmt::{self, Display, Formatter};

use super::check::{
    Quantity, check_code, check_flag, check_limits_scale, check_stamp, check_version, named_robot,
};
use super::goal::{Goal, STANDING, read};
use super::invalid::{Invalid, Reason, invalid};
use crate::PROTOCOL_VERSION;
use crate::codes::{GoalState, Outcome};
use crate::message;

/// A goal that the daemon keeps the robot on its way to; lengths metres, angles radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StandingGoal {
    /// When it was first given, nanoseconds of `CLOCK_MONOTONIC`: what it is known by.
    pub given_mono_ns: i64,
    /// When it was where it is told to be, nanoseconds of `CLOCK_MONOTONIC`.
    pub stamp_mono_ns: i64,
    /// The goal.
    pub goal: Goal,
    /// Velocity of a tip goal, base frame, m/s; believed for half a second from the stamp on. 0 of a configuration.
    pub tip_velocity_m_s: [f64; 3],
    /// Share of the tendon limits to use, [`LEAST_LIMITS_SCALE`](super::LEAST_LIMITS_SCALE) to 1.
    pub limits_scale: f64,
    /// [`message::RobotDescription::robot_hash`] of the robot file that the sender is set up for; none: it does not say.
    pub robot_hash: Option<u64>,
    /// Whether it is given up.
    pub is_withdrawn: bool,
}

impl StandingGoal {
    /// The wire form.
    #[must_use]
    pub fn to_wire(&self) -> message::StandingGoal {
        message::StandingGoal {
            given_mono_ns: self.given_mono_ns,
            stamp_mono_ns: self.stamp_mono_ns,
            goal: (&self.goal).into(),
            tip_velocity_m_s: self.tip_velocity_m_s,
            limits_scale: self.limits_scale,
            robot_hash: self.robot_hash.unwrap_or(0),
            protocol_version: PROTOCOL_VERSION,
            is_withdrawn: u32::from(self.is_withdrawn),
        }
    }
}

impl TryFrom<&message::StandingGoal> for StandingGoal {
    type Error = Invalid;

    fn try_from(wire: &message::StandingGoal) -> Result<Self, Invalid> {
        check_version(wire.protocol_version)?;
        let given_mono_ns = check_stamp("given_mono_ns", wire.given_mono_ns)?;
        let stamp_mono_ns = check_stamp("stamp_mono_ns", wire.stamp_mono_ns)?;
        if given_mono_ns == 0 || given_mono_ns > stamp_mono_ns {
            let value = given_mono_ns as f64;
            let allowed = "a time above 0, not later than stamp_mono_ns";
            return Err(invalid(
                "given_mono_ns",
                Reason::OutOfRange { value, allowed },
            ));
        }
        let goal = read(&wire.goal, &STANDING)?;
        Ok(Self {
            given_mono_ns,
            stamp_mono_ns,
            goal,
            tip_velocity_m_s: tip_velocity(wire, &goal)?,
            limits_scale: check_limits_scale(wire.limits_scale)?,
            robot_hash: named_robot(wire.robot_hash),
            is_withdrawn: check_flag("is_withdrawn", wire.is_withdrawn)?,
        })
    }
}

fn tip_velocity(wire: &message::StandingGoal, goal: &Goal) -> Result<[f64; 3], Invalid> {
    match goal {
        Goal::Tip { .. } => {
            let checked = Quantity::Rate.check_all(&wire.tip_velocity_m_s);
            checked.map_err(|reason| invalid("tip_velocity_m_s", reason))?;
            Ok(wire.tip_velocity_m_s)
        }
        Goal::Configuration(_) => Ok([0.0; 3]),
    }
}

/// What becomes of the goal that stays: its codes' meanings next to the values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GoalStatus {
    /// What becomes of it.
    pub state: GoalState,
    /// Outcome of the last plan made for it.
    pub outcome: Outcome,
    /// The values.
    pub values: message::GoalStatus,
}

impl TryFrom<&message::GoalStatus> for GoalStatus {
    type Error = Invalid;

    fn try_from(wire: &message::GoalStatus) -> Result<Self, Invalid> {
        let values = *wire;
        check_version(values.protocol_version)?;
        check_stamp("stamp_mono_ns", values.stamp_mono_ns)?;
        Ok(Self {
            state: check_code("state", values.state)?,
            outcome: check_code("outcome", values.outcome)?,
            values,
        })
    }
}

/// As in `no way to it now: goal out of reach`.
impl Display for GoalStatus {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        self.values.reason.write_after(&self.state, formatter)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message::ReasonText;
    use crate::valid::BadCase;

    fn goal() -> message::StandingGoal {
        StandingGoal {
            given_mono_ns: 5,
            stamp_mono_ns: 9,
            goal: Goal::Tip {
                position_m: [0.1, 0.2, 0.3],
                tolerance_m: None,
            },
            tip_velocity_m_s: [0.1, 0.0, 0.0],
            limits_scale: 0.5,
            robot_hash: Some(u64::MAX),
            is_withdrawn: false,
        }
        .to_wire()
    }

    #[test]
    fn what_was_written_is_read() {
        let read = StandingGoal::try_from(&goal()).unwrap();
        assert_eq!(read.to_wire(), goal());
        assert_eq!((read.given_mono_ns, read.limits_scale), (5, 0.5));
    }

    #[test]
    fn each_field_is_checked_and_named() {
        let cases: &[BadCase<message::StandingGoal>] = &[
            (|g| g.protocol_version = 1, "protocol_version is 1"),
            (
                |g| g.given_mono_ns = 0,
                "given_mono_ns is 0; allowed is a time",
            ),
            (
                |g| g.given_mono_ns = 10,
                "given_mono_ns is 10; allowed is a time",
            ),
            (|g| g.given_mono_ns = -1, "given_mono_ns is -1"),
            (|g| g.stamp_mono_ns = -1, "stamp_mono_ns is -1"),
            (|g| g.goal.kind = 7, "goal.kind: 7"),
            (|g| g.goal.tip_m[1] = f64::NAN, "goal.tip_m is NaN"),
            (
                |g| g.goal.tip_tolerance_m = -1.0,
                "goal.tip_tolerance_m is -1",
            ),
            (
                |g| g.limits_scale = 0.0,
                "limits_scale is 0; allowed is 1e-9..=1",
            ),
            (|g| g.limits_scale = f64::NAN, "limits_scale is NaN"),
            (|g| g.is_withdrawn = 2, "is_withdrawn is 2"),
        ];
        for (change, text) in cases {
            let mut wire = goal();
            change(&mut wire);
            let error = StandingGoal::try_from(&wire).expect_err(text);
            assert!(error.to_string().starts_with(text), "{error}");
        }
    }

    #[test]
    fn a_status_is_told_in_words() {
        let mut wire = message::GoalStatus {
            protocol_version: PROTOCOL_VERSION,
            state: GoalState::Unreachable.code(),
            outcome: Outcome::GoalOutOfReach.code(),
            reason: ReasonText::new("the tip is 4 m away"),
            ..message::GoalStatus::ZEROED
        };
        let status = GoalStatus::try_from(&wire).unwrap();
        assert_eq!(status.to_string(), "no way to it now: the tip is 4 m away");
        wire.state = 99;
        let error = GoalStatus::try_from(&wire).unwrap_err();
        assert!(error.to_string().starts_with("state: 99"), "{error}");
    }
}
