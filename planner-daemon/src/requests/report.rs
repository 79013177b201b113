//! Between the planner's units (lengths in sections) and the wire's (SI).

use pcc_model::UnitRobot;
use planning::{Candidate, Goal, Infeasible};
use shared_types::message::CandidateSummary;

use super::refusal::Refusal;

/// The summary of a candidate: lengths in metres, smoothness in square metres.
pub(crate) fn summary(
    candidate: &Candidate,
    first_knot: usize,
    tip_error: f64,
    robot: &UnitRobot,
) -> CandidateSummary {
    let metrics = &candidate.metrics;
    CandidateSummary {
        first_knot: first_knot as u32,
        knot_count: candidate.trajectory.knots().len() as u32,
        source: candidate.source.code(),
        draw: candidate.draw as u32,
        duration_s: metrics.duration_s,
        tip_path_m: robot.in_metres(metrics.tip_length),
        clearance_m: robot.in_metres(metrics.clearance),
        smoothness: metrics.tip_smoothness * robot.section_length_m().powi(2),
        tip_error_m: robot.in_metres(tip_error),
    }
}

/// Why a problem to this goal has no solution, with lengths in metres.
pub(crate) fn infeasible(infeasible: &Infeasible, goal: &Goal, robot: &UnitRobot) -> Refusal {
    let metres = |length: f64| format!("{:.4} m", robot.in_metres(length));
    let reason = match *infeasible {
        Infeasible::StartInCollision { clearance } => format!(
            "start in collision: clearance {}, at least 0 is needed",
            metres(clearance)
        ),
        Infeasible::GoalOutOfReach { miss } => match goal {
            Goal::Tip(_) => format!(
                "goal out of reach: the closest configuration found within the bending limit misses it by {}",
                metres(miss)
            ),
            Goal::Configuration(_) => {
                format!("goal out of reach: a section is bent {miss:.4} rad beyond the limit")
            }
        },
        Infeasible::GoalInCollision {
            configurations,
            clearance,
        } => format!(
            "goal in collision: the clearest of {configurations} goal configurations has clearance {}, at least 0 is needed",
            metres(clearance)
        ),
        Infeasible::StartOutOfLimits { .. }
        | Infeasible::StartTooFast { .. }
        | Infeasible::StartCannotStop => infeasible.to_string(),
    };
    Refusal::new(infeasible.outcome(), reason)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::robot_of_sections;
    use pcc_model::Configuration;
    use planning::{PathMetrics, Source};
    use shared_types::codes::Outcome;
    use trajectory::Trajectory;

    fn candidate() -> Candidate {
        let end = Configuration::repeat(0.25);
        let knots = [Configuration::zeros(), end];
        let knots = knots.iter().zip([0.0, 2.0]);
        let knots = knots.map(|(position, time)| trajectory::Knot::resting(time, *position));
        Candidate {
            trajectory: Trajectory::new(knots.collect()).unwrap().into(),
            metrics: PathMetrics {
                duration_s: 2.0,
                tip_length: 3.0,
                tip_distance: 2.5,
                tip_smoothness: 5.0,
                clearance: f64::INFINITY,
                configuration_length: 0.6,
            },
            source: Source::Classical,
            draw: 7,
            passages: Vec::new(),
        }
    }

    #[test]
    fn lengths_become_metres_and_nothing_else_changes() {
        let summary = summary(&candidate(), 96, 0.01, &robot_of_sections(0.2));
        let expected = CandidateSummary {
            first_knot: 96,
            knot_count: 2,
            source: 2,
            draw: 7,
            duration_s: 2.0,
            tip_path_m: 3.0 * 0.2,
            clearance_m: f64::INFINITY,
            smoothness: 5.0 * 0.2f64.powi(2),
            tip_error_m: 0.01 * 0.2,
        };
        assert_eq!(summary, expected);
    }

    #[test]
    fn what_is_infeasible_is_said_in_metres_and_radians() {
        let tip = Goal::Tip(pcc_model::Point::new(9.0, 0.0, 0.0));
        let shape = Goal::Configuration(Configuration::repeat(9.0));
        let (excess_rad, limit_rad) = (0.1, 1.5);
        let (clearance, configurations, miss) = (-0.1, 3, 0.5);
        let bent = Infeasible::StartOutOfLimits {
            excess_rad,
            limit_rad,
        };
        for (reason, goal, outcome, text) in [
            (bent, tip, Outcome::StartOutOfLimits, "0.1000 rad"),
            (
                Infeasible::StartInCollision { clearance },
                tip,
                Outcome::StartInCollision,
                "clearance -0.0200 m",
            ),
            (
                Infeasible::GoalOutOfReach { miss },
                tip,
                Outcome::GoalOutOfReach,
                "by 0.1000 m",
            ),
            (
                Infeasible::GoalOutOfReach { miss },
                shape,
                Outcome::GoalOutOfReach,
                "bent 0.5000 rad",
            ),
            (
                Infeasible::GoalInCollision {
                    configurations,
                    clearance,
                },
                tip,
                Outcome::GoalInCollision,
                "3 goal configurations has clearance -0.0200 m",
            ),
        ] {
            let refusal = infeasible(&reason, &goal, &robot_of_sections(0.2));
            assert_eq!(refusal.outcome, outcome);
            assert!(refusal.reason.contains(text), "{}", refusal.reason);
            assert!(
                refusal.reason.starts_with(outcome.text()),
                "{}",
                refusal.reason
            );
        }
    }
}
