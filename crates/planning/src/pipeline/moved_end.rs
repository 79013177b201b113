//! A target that moves: the end of the motion that is followed is moved to it.

use crate::goals::inverse_kinematics::configuration_near;
use crate::pipeline::context::RequestContext;
use crate::plan::Draw;
use crate::problem::Goal;
use codes::Source;
use pcc_model::Configuration;
use trajectory::{Trajectory, limit_use};

/// Times within which the end is moved, s: the first one with which the motion keeps the limits counts. Moved within less, an end that
/// follows a target at 0.3 section lengths a second uses so much of the limits that it cannot be moved again soon.
const WITHIN_S: [f64; 5] = [0.42, 0.55, 0.71, 0.92, 1.26];
/// Farthest that a tip is moved, section lengths.
const FARTHEST: f64 = 0.15;
/// Least that an end is moved, rad: rounding.
const LEAST_RAD: f64 = 1e-6;
/// Relative amount by which a limit may be exceeded: the rounding of the measure.
const ROUNDING: f64 = 1e-9;

/// The motion that is followed with its end moved to the goal, where that is near and the motion is certified.
pub(super) fn draw(context: &RequestContext) -> Option<Draw> {
    let followed = context.request.end_to_move.as_ref()?;
    let by = goal_configuration(context, &followed.left)? - followed.left.end();
    if by.norm() < LEAST_RAD {
        return None;
    }
    let start = &context.problem.start;
    let constraints = context.constraints.bending_no_more_than(start);
    let (tendons, limits) = (&constraints.robot.tendons, &constraints.limits);
    let keeps_limits = |motion: &Trajectory| {
        motion.knots().len() <= followed.knots
            && limit_use(motion, tendons, limits).largest() <= 1.0 + ROUNDING
    };
    let mut moved = WITHIN_S
        .iter()
        .filter_map(|within_s| followed.left.with_end_moved(&by, *within_s));
    let motion = moved.find(keeps_limits)?;
    let certified = constraints.certified(motion).ok()?;
    Some(Draw {
        sampled: None,
        path: None,
        source: Source::MovedEnd,
        outcome: Ok(certified),
    })
}

/// The goal configuration next to where the motion ends; none of a goal that is no tip, or is farther from there than the end is moved.
fn goal_configuration(context: &RequestContext, left: &Trajectory) -> Option<Configuration> {
    let (robot, end) = (&context.resources.robot, left.end());
    let goal = &context.problem.goal;
    let is_near =
        matches!(goal, Goal::Tip(target) if (robot.tip(&end) - target).norm() <= FARTHEST);
    is_near
        .then(|| configuration_near(robot, goal, &end))
        .flatten()
}
