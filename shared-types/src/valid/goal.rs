//! The validated goals of a plan request, and their wire form.

use super::check::{Quantity, check_code, check_count, check_distance};
use super::invalid::{Invalid, invalid, invalid_at};
use crate::capacity::{DOF, MAX_GOALS};
use crate::codes::GoalKind;
use crate::message;

/// What the motion is to reach, or to pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Goal {
    /// Any configuration that puts the tip at a position.
    Tip {
        /// Position in the base frame, metres.
        position_m: [f64; 3],
        /// Distance that counts as reached, metres; none: a hundredth of a section's length.
        tolerance_m: Option<f64>,
    },
    /// This configuration, radians.
    Configuration([f64; DOF]),
}

impl Goal {
    /// The tip at a position, metres in the base frame, within a hundredth of a section's length.
    #[must_use]
    pub const fn tip(position_m: [f64; 3]) -> Self {
        Self::Tip {
            position_m,
            tolerance_m: None,
        }
    }
}

/// The goals of a request, the last one apart.
pub(super) fn goals(wire: &message::PlanRequest) -> Result<(Vec<Goal>, Goal), Invalid> {
    let count = check_count("goal_count", wire.goal_count, 1, MAX_GOALS)?;
    let goals = wire.goals[..count].iter().enumerate();
    let mut goals: Vec<Goal> = goals
        .map(|(index, goal)| {
            let at_index = |Invalid { field, reason, .. }| invalid_at(field, index, reason);
            read(goal, &OF_A_REQUEST).map_err(at_index)
        })
        .collect::<Result<_, _>>()?;
    let last = goals.remove(count - 1);
    Ok((goals, last))
}

/// How a message calls the fields of a goal.
pub(super) struct GoalFields {
    kind: &'static str,
    tip: &'static str,
    tolerance: &'static str,
    configuration: &'static str,
}

/// The fields of [`message::PlanRequest::goals`].
const OF_A_REQUEST: GoalFields = GoalFields {
    kind: "goals.kind",
    tip: "goals.tip_m",
    tolerance: "goals.tip_tolerance_m",
    configuration: "goals.configuration_rad",
};
/// The fields of [`message::StandingGoal::goal`].
pub(super) const STANDING: GoalFields = GoalFields {
    kind: "goal.kind",
    tip: "goal.tip_m",
    tolerance: "goal.tip_tolerance_m",
    configuration: "goal.configuration_rad",
};

/// The fields of a goal by itself.
const ALONE: GoalFields = GoalFields {
    kind: "kind",
    tip: "tip_m",
    tolerance: "tip_tolerance_m",
    configuration: "configuration_rad",
};

impl TryFrom<&message::Goal> for Goal {
    type Error = Invalid;

    fn try_from(wire: &message::Goal) -> Result<Self, Invalid> {
        read(wire, &ALONE)
    }
}

/// A goal on the wire.
pub(super) fn read(wire: &message::Goal, fields: &GoalFields) -> Result<Goal, Invalid> {
    let kind = u32::try_from(wire.kind).unwrap_or(u32::MAX);
    match check_code(fields.kind, kind)? {
        GoalKind::Tip => {
            let checked = Quantity::Length.check_all(&wire.tip_m);
            checked.map_err(|reason| invalid(fields.tip, reason))?;
            let tolerance_m = check_distance(wire.tip_tolerance_m);
            let tolerance_m = tolerance_m.map_err(|reason| invalid(fields.tolerance, reason))?;
            Ok(Goal::Tip {
                position_m: wire.tip_m,
                tolerance_m: (tolerance_m > 0.0).then_some(tolerance_m),
            })
        }
        GoalKind::Configuration => {
            let checked = Quantity::Angle.check_all(&wire.configuration_rad);
            checked.map_err(|reason| invalid(fields.configuration, reason))?;
            Ok(Goal::Configuration(wire.configuration_rad))
        }
    }
}

impl From<&Goal> for message::Goal {
    fn from(goal: &Goal) -> Self {
        match *goal {
            Goal::Tip {
                position_m,
                tolerance_m,
            } => Self {
                kind: u64::from(GoalKind::Tip.code()),
                tip_m: position_m,
                tip_tolerance_m: tolerance_m.unwrap_or(0.0),
                ..Self::ZEROED
            },
            Goal::Configuration(configuration_rad) => Self {
                kind: u64::from(GoalKind::Configuration.code()),
                configuration_rad,
                ..Self::ZEROED
            },
        }
    }
}
