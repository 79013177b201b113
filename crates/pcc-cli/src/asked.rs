//! What a command line asks of a motion, for messages about what cannot be planned.

use crate::number::spaced;
use planning::Infeasible;
use shared_types::codes::Outcome;
use std::iter::once;

/// Options that a message repeats.
const SHOWN: usize = 5;

/// The options that say where a motion begins and ends, and past which balls it leads.
pub(crate) struct Asked<'a> {
    pub(crate) start: Option<&'a [f64]>,
    pub(crate) tip: Option<&'a [f64]>,
    pub(crate) configuration: Option<&'a [f64]>,
    /// Four values a ball.
    pub(crate) balls: &'a [f64],
}

/// What of them is not as it must be.
pub(crate) enum Wrong {
    StartBent,
    StartInCollision,
    GoalOutOfReach,
    GoalInCollision,
}

impl Wrong {
    /// What an answer of the daemon is about; none where it is about no option.
    pub(crate) fn of_outcome(outcome: Outcome) -> Option<Self> {
        match outcome {
            Outcome::StartOutOfLimits => Some(Self::StartBent),
            Outcome::StartInCollision => Some(Self::StartInCollision),
            Outcome::GoalOutOfReach => Some(Self::GoalOutOfReach),
            Outcome::GoalInCollision => Some(Self::GoalInCollision),
            _ => None,
        }
    }

    /// What a refusal of the planner is about; none where it is about no option.
    pub(crate) fn of(reason: &Infeasible) -> Option<Self> {
        match reason {
            Infeasible::StartOutOfLimits { .. } => Some(Self::StartBent),
            Infeasible::StartInCollision { .. } => Some(Self::StartInCollision),
            Infeasible::GoalOutOfReach { .. } => Some(Self::GoalOutOfReach),
            Infeasible::GoalInCollision { .. } => Some(Self::GoalInCollision),
            // The options say of no start that it moves.
            Infeasible::StartTooFast { .. } | Infeasible::StartCannotStop => None,
        }
    }
}

impl Asked<'_> {
    /// The options that something is wrong with, and what they must hold.
    pub(crate) fn blamed(&self, wrong: &Wrong) -> String {
        let needed = match wrong {
            Wrong::GoalOutOfReach if self.tip.is_some() => "a position that the tip reaches",
            Wrong::StartBent | Wrong::GoalOutOfReach => "no section bent beyond the robot's limit",
            Wrong::StartInCollision => "a start that touches no obstacle",
            Wrong::GoalInCollision => "a goal that touches no obstacle",
        };
        let options = self.options(wrong);
        let shown = &options[..options.len().min(SHOWN)];
        match shown {
            [] => format!("{needed} is needed"),
            shown => format!("{}: {needed} is needed", shown.join(" ")),
        }
    }

    fn options(&self, wrong: &Wrong) -> Vec<String> {
        let of = |name: &str, values: &[f64]| format!("--{name} {}", spaced(values));
        let start = self.start.map(|values| of("start", values));
        let goal = (self.tip.map(|values| of("tip", values)))
            .or_else(|| self.configuration.map(|values| of("configuration", values)));
        let balls = self.balls.chunks(4).map(|values| of("ball", values));
        match wrong {
            Wrong::StartBent => start.into_iter().collect(),
            Wrong::GoalOutOfReach => goal.into_iter().collect(),
            Wrong::StartInCollision => once(start).flatten().chain(balls).collect(),
            Wrong::GoalInCollision => once(goal).flatten().chain(balls).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_repeats_the_options_that_it_is_about() {
        let asked = Asked {
            start: None,
            tip: Some(&[0.0, 0.5, 5e-324]),
            configuration: None,
            balls: &[0.5; 4 * 64],
        };
        assert_eq!(
            asked.blamed(&Wrong::GoalOutOfReach),
            "--tip 0.0 0.5 5e-324: a position that the tip reaches is needed"
        );
        let said = asked.blamed(&Wrong::StartInCollision);
        assert_eq!(said.matches("--ball 0.5 0.5 0.5 0.5").count(), SHOWN);
        assert!(asked.blamed(&Wrong::StartBent).starts_with("no section"));
    }
}
