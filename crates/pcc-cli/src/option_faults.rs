//! Messages about command-line options that describe a motion which cannot be planned.

use crate::number::spaced;
use planning::Infeasible;
use shared_types::codes::Outcome;
use std::iter::once;

/// The most options that a message repeats.
const SHOWN: usize = 5;

/// The options that describe a motion: where it begins and ends, and the balls that it must avoid.
pub(crate) struct MotionOptions<'a> {
    pub(crate) start: Option<&'a [f64]>,
    pub(crate) tip: Option<&'a [f64]>,
    pub(crate) configuration: Option<&'a [f64]>,
    /// Four values a ball.
    pub(crate) balls: &'a [f64],
}

/// What is wrong with the options that describe a motion.
pub(crate) enum OptionFault {
    StartBent,
    StartInCollision,
    GoalOutOfReach,
    GoalInCollision,
}

impl OptionFault {
    /// The fault that an answer of the daemon reports; none where no option is at fault.
    pub(crate) fn of_outcome(outcome: Outcome) -> Option<Self> {
        match outcome {
            Outcome::StartOutOfLimits => Some(Self::StartBent),
            Outcome::StartInCollision => Some(Self::StartInCollision),
            Outcome::GoalOutOfReach => Some(Self::GoalOutOfReach),
            Outcome::GoalInCollision => Some(Self::GoalInCollision),
            _ => None,
        }
    }

    /// The fault that a refusal of the planner reports; none where no option is at fault.
    pub(crate) fn of(reason: &Infeasible) -> Option<Self> {
        match reason {
            Infeasible::StartOutOfLimits { .. } => Some(Self::StartBent),
            Infeasible::StartInCollision { .. } => Some(Self::StartInCollision),
            Infeasible::GoalOutOfReach { .. } => Some(Self::GoalOutOfReach),
            Infeasible::GoalInCollision { .. } => Some(Self::GoalInCollision),
            // No option gives the start a velocity.
            Infeasible::StartTooFast { .. } | Infeasible::StartCannotStop => None,
        }
    }
}

impl MotionOptions<'_> {
    /// The options that are at fault, and the values that they need.
    pub(crate) fn explain(&self, fault: &OptionFault) -> String {
        let needed = match fault {
            OptionFault::GoalOutOfReach if self.tip.is_some() => "a position that the tip reaches",
            OptionFault::StartBent | OptionFault::GoalOutOfReach => {
                "no section bent beyond the robot's limit"
            }
            OptionFault::StartInCollision => "a start that touches no obstacle",
            OptionFault::GoalInCollision => "a goal that touches no obstacle",
        };
        let options = self.options(fault);
        let shown = &options[..options.len().min(SHOWN)];
        match shown {
            [] => format!("{needed} is needed"),
            shown => format!("{}: {needed} is needed", shown.join(" ")),
        }
    }

    fn options(&self, fault: &OptionFault) -> Vec<String> {
        let of = |name: &str, values: &[f64]| format!("--{name} {}", spaced(values));
        let start = self.start.map(|values| of("start", values));
        let goal = (self.tip.map(|values| of("tip", values)))
            .or_else(|| self.configuration.map(|values| of("configuration", values)));
        let balls = self.balls.chunks(4).map(|values| of("ball", values));
        match fault {
            OptionFault::StartBent => start.into_iter().collect(),
            OptionFault::GoalOutOfReach => goal.into_iter().collect(),
            OptionFault::StartInCollision => once(start).flatten().chain(balls).collect(),
            OptionFault::GoalInCollision => once(goal).flatten().chain(balls).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_repeats_the_options_that_it_is_about() {
        let options = MotionOptions {
            start: None,
            tip: Some(&[0.0, 0.5, 5e-324]),
            configuration: None,
            balls: &[0.5; 4 * 64],
        };
        assert_eq!(
            options.explain(&OptionFault::GoalOutOfReach),
            "--tip 0.0 0.5 5e-324: a position that the tip reaches is needed"
        );
        let said = options.explain(&OptionFault::StartInCollision);
        assert_eq!(said.matches("--ball 0.5 0.5 0.5 0.5").count(), SHOWN);
        assert!(
            options
                .explain(&OptionFault::StartBent)
                .starts_with("no section")
        );
    }
}
