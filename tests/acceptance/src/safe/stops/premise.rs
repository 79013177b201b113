//! What stops are tried on, and how exactly they are judged.

use pcc_model::Robot;
use trajectory::Trajectory;

use super::motions;
use crate::report::Report;

/// The largest step of jerk that each motion has at least, of the jerk limit.
const LEAST_JERK_STEP: f64 = 0.1;
/// How far above a limit rounding may bring a figure.
pub(super) const ROUNDING: f64 = 1.0 + 1e-6;
/// How far from its path rounding may bring a set-point, rad.
pub(super) const ON_PATH_RAD: f64 = 1e-9;

/// The premise: each motion has a step of jerk.
pub(super) fn have_jerk_steps(
    report: &mut Report,
    about: &str,
    robot: &Robot,
    motions: &[Trajectory],
) {
    let with_steps = motions::largest_jerk_steps(robot, motions);
    let least = with_steps.iter().copied().fold(f64::INFINITY, f64::min);
    let name =
        format!("{about}: motions with steps of jerk, the least of their largest ÷ jerk limit");
    let all_have = least >= LEAST_JERK_STEP && !motions.is_empty();
    let figure = format!("{least:.3} of {} motions", motions.len());
    let bar = format!(">= {LEAST_JERK_STEP}, all");
    report.check(&name, figure, &bar, all_have);
}
