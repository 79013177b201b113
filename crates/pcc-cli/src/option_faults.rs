//! Messages about command-line options that describe a motion which cannot be planned.

use crate::number::spaced;
use shared_types::codes::Outcome;

/// The most options that a message repeats.
const SHOWN: usize = 5;
/// What an end of a motion needs that bends too far.
const UNBENT: &str = "no section bent beyond the robot's limit";

/// The options that describe a motion: where it begins and ends, and the balls that it must avoid.
pub(crate) struct MotionOptions<'a> {
    pub(crate) start: Option<&'a [f64]>,
    /// Three values a tip.
    pub(crate) tip: Option<&'a [f64]>,
    /// Six values a configuration.
    pub(crate) configuration: Option<&'a [f64]>,
    /// Four values a ball.
    pub(crate) balls: &'a [f64],
}

impl MotionOptions<'_> {
    /// The options that are at fault for an outcome, and the values that they need; none where no option is.
    pub(crate) fn explain(&self, outcome: Outcome) -> Option<String> {
        let of = |name: &str, values: &[f64]| format!("--{name} {}", spaced(values));
        let start = self.start.map(|values| of("start", values)).into_iter();
        let goals = |name, values: Option<&[f64]>, each| {
            let goals = values.unwrap_or_default().chunks(each);
            goals.map(|values| of(name, values)).collect::<Vec<_>>()
        };
        let tips = goals("tip", self.tip, 3).into_iter();
        let goal = tips.chain(goals("configuration", self.configuration, 6));
        let balls = self.balls.chunks(4).map(|values| of("ball", values));
        let (options, needed): (Vec<String>, _) = match outcome {
            Outcome::StartOutOfLimits => (start.collect(), UNBENT),
            Outcome::StartInCollision => (
                start.chain(balls).collect(),
                "a start that touches no obstacle",
            ),
            Outcome::GoalOutOfReach if self.tip.is_some() => {
                (goal.collect(), "a position that the tip reaches")
            }
            Outcome::GoalOutOfReach => (goal.collect(), UNBENT),
            Outcome::GoalInCollision => (
                goal.chain(balls).collect(),
                "a goal that touches no obstacle",
            ),
            _ => return None,
        };
        Some(match &options[..options.len().min(SHOWN)] {
            [] => format!("{needed} is needed"),
            shown => format!("{}: {needed} is needed", shown.join(" ")),
        })
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
            options.explain(Outcome::GoalOutOfReach).as_deref(),
            Some("--tip 0.0 0.5 5e-324: a position that the tip reaches is needed")
        );
        let said = options.explain(Outcome::StartInCollision).unwrap();
        assert_eq!(said.matches("--ball 0.5 0.5 0.5 0.5").count(), SHOWN);
        let said = options.explain(Outcome::StartOutOfLimits).unwrap();
        assert!(said.starts_with("no section"));
        assert_eq!(options.explain(Outcome::NoPath), None);
    }
}
