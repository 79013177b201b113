//! How far from a goal a tip may be.

use pcc_model::UnitRobot;
use shared_types::valid::Goal;

/// Distance from the goal that counts as reached where the goal does not say, section lengths.
const DEFAULT: f64 = 0.01;

/// Distance of the tip from a goal that counts as reached, section lengths.
pub(crate) fn tip_tolerance(goal: &Goal, robot: &UnitRobot) -> f64 {
    match goal {
        Goal::Tip {
            tolerance_m: Some(tolerance_m),
            ..
        } => robot.in_section_lengths(*tolerance_m),
        _ => DEFAULT,
    }
}
