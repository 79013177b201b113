//! How a motion ended.

use std::fmt::{self, Display, Formatter};

use super::check::{check_code, check_stamp, check_time};
use super::invalid::{Invalid, Reason, invalid};
use crate::codes::{CommandSender, LoopFault, MotionOutcome, Refusal, StopCause};
use crate::message;

/// How a trajectory ended that a controller has received: its codes' meanings next to the values, all finite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionResult {
    /// How it ended.
    pub outcome: MotionOutcome,
    /// What stopped it or set it aside; `None` where it was neither.
    pub cause: StopCause,
    /// Who gave the command that stopped it, where the cause is a command.
    pub sender: CommandSender,
    /// The fault that stopped it; `None` where the cause is no fault.
    pub fault: LoopFault,
    /// Why it was refused; `None` where it was not.
    pub refusal: Refusal,
    /// The values.
    pub values: message::MotionResult,
}

impl TryFrom<&message::MotionResult> for MotionResult {
    type Error = Invalid;

    fn try_from(wire: &message::MotionResult) -> Result<Self, Invalid> {
        let values = *wire;
        check_stamp("stamp_mono_ns", values.stamp_mono_ns)?;
        check_time("path_time_s", values.path_time_s)?;
        check_time("duration_s", values.duration_s)?;
        let outcome = check_code("outcome", values.outcome)?;
        let is_joined = outcome == MotionOutcome::Joined;
        if is_joined != (values.joined_by != 0) {
            let value = f64::from(values.joined_by);
            let allowed = "a trajectory where it was joined by one, else 0";
            return Err(invalid("joined_by", Reason::OutOfRange { value, allowed }));
        }
        Ok(Self {
            outcome,
            cause: check_code("cause", values.cause)?,
            sender: check_code("sender", values.sender)?,
            fault: check_code("fault", values.fault)?,
            refusal: check_code("refusal", values.refusal)?,
            values,
        })
    }
}

/// As in `stopped: the live scene is in the way at 1.200 s of it`.
impl Display for MotionResult {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        self.values.reason.write_after(&self.outcome, formatter)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message::ReasonText;
    use crate::valid::BadCase;

    fn stopped() -> message::MotionResult {
        message::MotionResult {
            outcome: MotionOutcome::Stopped.code(),
            cause: StopCause::Command.code(),
            sender: CommandSender::Supervision.code(),
            reason: ReasonText::new("the live scene is in the way"),
            ..message::MotionResult::ZEROED
        }
    }

    #[test]
    fn a_result_is_told_in_words() {
        let result = MotionResult::try_from(&stopped()).unwrap();
        assert_eq!(result.to_string(), "stopped: the live scene is in the way");
        let joined = message::MotionResult {
            outcome: MotionOutcome::Joined.code(),
            joined_by: 8,
            ..message::MotionResult::ZEROED
        };
        let joined = MotionResult::try_from(&joined).unwrap();
        assert_eq!(joined.to_string(), "joined by another trajectory");
    }

    #[test]
    fn each_field_is_checked_and_named() {
        let cases: &[BadCase<message::MotionResult>] = &[
            (|r| r.stamp_mono_ns = -1, "stamp_mono_ns is -1"),
            (|r| r.outcome = 0, "outcome: 0 is no outcome of a motion"),
            (|r| r.cause = 99, "cause: 99"),
            (|r| r.sender = 99, "sender: 99"),
            (|r| r.fault = 99, "fault: 99"),
            (|r| r.refusal = 99, "refusal: 99"),
            (|r| r.path_time_s = f64::NAN, "path_time_s is NaN"),
            (
                |r| r.duration_s = -1.0,
                "duration_s is -1; allowed is 0..=1e6 s",
            ),
            (
                |r| r.joined_by = 3,
                "joined_by is 3; allowed is a trajectory",
            ),
            (|r| r.outcome = 2, "joined_by is 0; allowed is a trajectory"),
        ];
        for (change, text) in cases {
            let mut wire = stopped();
            change(&mut wire);
            let error = MotionResult::try_from(&wire).expect_err(text);
            assert!(error.to_string().starts_with(text), "{error}");
        }
    }
}
