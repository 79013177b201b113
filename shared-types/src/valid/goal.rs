//! The validated goals of a plan request, and their wire form.

use super::check::{Quantity, check_code, check_count, check_distance};
use super::invalid::{Invalid, Reason, invalid_at};
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

/// The goals of a request, the last one apart.
pub(super) fn goals(wire: &message::PlanRequest) -> Result<(Vec<Goal>, Goal), Invalid> {
    let count = check_count("goal_count", wire.goal_count, 1, MAX_GOALS)?;
    let goals = wire.goals[..count].iter().enumerate();
    let mut goals: Vec<Goal> = goals
        .map(|(index, goal)| read(goal, index))
        .collect::<Result<_, _>>()?;
    let last = goals.remove(count - 1);
    Ok((goals, last))
}

fn read(wire: &message::Goal, index: usize) -> Result<Goal, Invalid> {
    let at = |field| move |reason: Reason| invalid_at(field, index, reason);
    let kind = u32::try_from(wire.kind).unwrap_or(u32::MAX);
    let kind = check_code("goals.kind", kind)
        .map_err(|invalid: Invalid| invalid_at(invalid.field, index, invalid.reason))?;
    match kind {
        GoalKind::Tip => {
            let length = Quantity::Length;
            length.check_all(&wire.tip_m).map_err(at("goals.tip_m"))?;
            let tolerance_m = check_distance(wire.tip_tolerance_m);
            let tolerance_m = tolerance_m.map_err(at("goals.tip_tolerance_m"))?;
            Ok(Goal::Tip {
                position_m: wire.tip_m,
                tolerance_m: (tolerance_m > 0.0).then_some(tolerance_m),
            })
        }
        GoalKind::Configuration => {
            let checked = Quantity::Angle.check_all(&wire.configuration_rad);
            checked.map_err(at("goals.configuration_rad"))?;
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
