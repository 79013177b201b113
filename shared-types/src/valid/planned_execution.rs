//! The validated request to execute a candidate of an earlier plan, and its wire form.

use super::check::{check_code, check_count, check_optional_stamp, check_version, named_robot};
use super::invalid::{Invalid, Reason, invalid};
use super::plan::{PlanRequest, PreviousPlan, check_requested, named_plan};
use crate::PROTOCOL_VERSION;
use crate::clock::mono_now_ns;
use crate::codes::Execute;
use crate::message::{self, NONE_SELECTED};

/// What a request on the service `plan` asks for.
#[derive(Clone, Debug, PartialEq)]
pub enum Asked {
    /// A plan, whose selected candidate may be executed.
    Plan(Box<PlanRequest>),
    /// The execution of a candidate of an earlier plan.
    Execution(PlannedExecution),
}

impl Asked {
    /// [`message::RobotDescription::robot_hash`] of the robot file that the sender is set up for; none: it does not say.
    #[must_use]
    pub fn robot_hash(&self) -> Option<u64> {
        match self {
            Self::Plan(request) => request.robot_hash,
            Self::Execution(execution) => execution.robot_hash,
        }
    }
}

impl TryFrom<&message::PlanRequest> for Asked {
    type Error = Invalid;

    fn try_from(wire: &message::PlanRequest) -> Result<Self, Invalid> {
        check_version(wire.protocol_version)?;
        match check_code("execute", wire.execute)? {
            Execute::Named => PlannedExecution::try_from(wire).map(Self::Execution),
            Execute::Nothing | Execute::Selected => {
                PlanRequest::try_from(wire).map(|request| Self::Plan(Box::new(request)))
            }
        }
    }
}

/// A request to execute a candidate of an earlier plan, exactly as it was answered; nothing is planned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlannedExecution {
    /// The sender's number of the request.
    pub request_id: u64,
    /// The plan, and which of its candidates; none: the one that was selected.
    pub plan: PreviousPlan,
    /// When the motion begins if it begins at rest, nanoseconds of `CLOCK_MONOTONIC`; none: as soon as possible.
    pub begin_mono_ns: Option<i64>,
    /// When it was asked for, nanoseconds of `CLOCK_MONOTONIC`, never 0: what is asked for before a stop is not executed.
    pub requested_mono_ns: i64,
    /// [`message::RobotDescription::robot_hash`] of the robot file that the sender is set up for; none: it does not say.
    pub robot_hash: Option<u64>,
}

impl PlannedExecution {
    /// A request of this moment, for a begin as soon as possible.
    #[must_use]
    pub fn now(plan_id: u64, candidate: Option<usize>) -> Self {
        Self {
            request_id: 0,
            plan: PreviousPlan { plan_id, candidate },
            begin_mono_ns: None,
            requested_mono_ns: mono_now_ns(),
            robot_hash: None,
        }
    }
}

impl TryFrom<&message::PlanRequest> for PlannedExecution {
    type Error = Invalid;

    fn try_from(wire: &message::PlanRequest) -> Result<Self, Invalid> {
        check_version(wire.protocol_version)?;
        let execute: Execute = check_code("execute", wire.execute)?;
        if execute != Execute::Named {
            let what = "executing an earlier plan by a request that plans";
            return Err(invalid("execute", Reason::NotServed { what }));
        }
        for (field, count) in [
            ("goal_count", wire.goal_count),
            ("ball_count", wire.ball_count),
            ("early_candidate_count", wire.early_candidate_count),
        ] {
            check_count(field, count, 0, 0)?;
        }
        let none_named = Reason::OutOfRange {
            value: 0.0,
            allowed: "the plan_id of an earlier answer, at least 1",
        };
        let plan = named_plan(wire)?;
        Ok(Self {
            request_id: wire.request_id,
            plan: plan.ok_or(invalid("previous_plan_id", none_named))?,
            begin_mono_ns: check_optional_stamp("begin_mono_ns", wire.begin_mono_ns)?,
            requested_mono_ns: check_requested(wire)?,
            robot_hash: named_robot(wire.robot_hash),
        })
    }
}

impl TryFrom<&PlannedExecution> for message::PlanRequest {
    type Error = Invalid;

    /// Writes the wire form; fails where that would not be accepted.
    fn try_from(execution: &PlannedExecution) -> Result<Self, Invalid> {
        let candidate = execution.plan.candidate;
        let wire = Self {
            protocol_version: PROTOCOL_VERSION,
            request_id: execution.request_id,
            execute: Execute::Named.code(),
            previous_plan_id: execution.plan.plan_id,
            previous_candidate: candidate.map_or(NONE_SELECTED, wire_index),
            begin_mono_ns: execution.begin_mono_ns.unwrap_or(0),
            requested_mono_ns: execution.requested_mono_ns,
            robot_hash: execution.robot_hash.unwrap_or(0),
            ..Self::ZEROED
        };
        PlannedExecution::try_from(&wire)?;
        Ok(wire)
    }
}

/// An index that does not fit is too large for every plan, and not the selected candidate's.
fn wire_index(index: usize) -> u32 {
    u32::try_from(index).map_or(NONE_SELECTED - 1, |index| index.min(NONE_SELECTED - 1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codes::PlanField;

    fn wire() -> message::PlanRequest {
        (&PlannedExecution::now(7, Some(2))).try_into().unwrap()
    }

    #[test]
    fn it_survives_the_wire_and_needs_neither_goals_nor_candidates() {
        for candidate in [None, Some(0), Some(63)] {
            let execution = PlannedExecution {
                request_id: 3,
                begin_mono_ns: candidate.map(|_| 9),
                robot_hash: candidate.map(|_| u64::MAX),
                ..PlannedExecution::now(7, candidate)
            };
            let mut wire = message::PlanRequest::try_from(&execution).unwrap();
            (wire.sampler, wire.limits_scale) = (99, f64::NAN);
            wire.goals[0].tip_m[0] = f64::NAN;
            assert_eq!(Asked::try_from(&wire), Ok(Asked::Execution(execution)));
        }
    }

    #[test]
    fn each_field_is_checked_and_named() {
        type Case = (fn(&mut message::PlanRequest), PlanField, &'static str);
        let cases: &[Case] = &[
            (
                |r| r.protocol_version = 3,
                PlanField::ProtocolVersion,
                "speaks 7",
            ),
            (
                |r| r.execute = 3,
                PlanField::Execute,
                "2 (a candidate of an earlier plan)",
            ),
            (
                |r| r.goal_count = 1,
                PlanField::GoalCount,
                "is 1; allowed is 0..=0",
            ),
            (
                |r| r.ball_count = 2,
                PlanField::BallCount,
                "is 2; allowed is 0..=0",
            ),
            (
                |r| r.early_candidate_count = 1,
                PlanField::EarlyCandidateCount,
                "0..=0",
            ),
            (
                |r| r.previous_plan_id = 0,
                PlanField::PreviousPlan,
                "at least 1",
            ),
            (
                |r| r.previous_candidate = 64,
                PlanField::PreviousCandidate,
                "0..=63",
            ),
            (|r| r.begin_mono_ns = -1, PlanField::Begin, "0 or later"),
            (
                |r| r.requested_mono_ns = -1,
                PlanField::Requested,
                "0 or later",
            ),
            (
                |r| r.requested_mono_ns = 0,
                PlanField::Requested,
                "the time of CLOCK_MONOTONIC",
            ),
        ];
        for (change, field, text) in cases {
            let mut wire = wire();
            change(&mut wire);
            let error = Asked::try_from(&wire).expect_err(text);
            assert_eq!(error.plan_field(), *field, "{error}");
            assert!(error.to_string().contains(text), "{error}: no {text:?}");
        }
    }

    #[test]
    fn one_kind_of_request_is_not_read_as_the_other() {
        let error = PlanRequest::try_from(&wire()).unwrap_err();
        assert_eq!(error.plan_field(), PlanField::Execute);
        let plans = message::PlanRequest {
            execute: Execute::Selected.code(),
            ..wire()
        };
        let error = PlannedExecution::try_from(&plans).unwrap_err();
        assert_eq!(error.plan_field(), PlanField::Execute);
        assert!(Asked::try_from(&plans).is_err(), "it has no goal");
    }

    #[test]
    fn a_candidate_that_does_not_fit_the_wire_is_refused_by_the_sender() {
        for candidate in [64, u32::MAX as usize, usize::MAX] {
            let execution = PlannedExecution::now(7, Some(candidate));
            let error = message::PlanRequest::try_from(&execution).unwrap_err();
            assert_eq!(error.plan_field(), PlanField::PreviousCandidate);
        }
    }
}
