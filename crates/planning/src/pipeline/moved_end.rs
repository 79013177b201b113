//! A target that moves: the end of the motion that is followed is moved to it.

use crate::goals::inverse_kinematics::{is_solved, solve_tip};
use crate::pipeline::context::RequestContext;
use crate::plan::Draw;
use crate::problem::Goal;
use codes::Source;
use pcc_model::Configuration;
use trajectory::{MAX_KNOTS, Trajectory, limit_use};

/// Times within which the end is moved, s: the first one with which the motion keeps the limits counts. Moved within less, the end of a target at
/// 0.3 m/s uses the limits so much that it cannot be moved again soon.
const WITHIN_S: [f64; 5] = [0.42, 0.55, 0.71, 0.92, 1.26];
/// Farthest that a tip is moved, section lengths.
const FARTHEST: f64 = 0.15;
/// Relative amount by which a limit may be exceeded: the rounding of the measure.
const ROUNDING: f64 = 1e-9;

/// The motion that is followed with its end moved to the goal, where that is near and the motion is certified.
pub(super) fn draw(context: &RequestContext) -> Option<Draw> {
    let followed = context.request.followed.as_ref()?;
    let by = goal_configuration(context, followed)? - followed.end();
    if by == Configuration::zeros() {
        return None;
    }
    let start = &context.problem.start;
    let constraints = context.constraints.bending_no_more_than(start);
    let (tendons, limits) = (&constraints.robot.tendons, &constraints.limits);
    let keeps_limits = |motion: &Trajectory| {
        motion.knots().len() <= MAX_KNOTS
            && limit_use(motion, tendons, limits).largest() <= 1.0 + ROUNDING
    };
    let mut moved = WITHIN_S
        .iter()
        .filter_map(|within_s| followed.with_end_moved(&by, *within_s));
    let motion = moved.find(keeps_limits)?;
    let certified = constraints.certified(motion).ok()?;
    Some(Draw {
        sampled: None,
        path: None,
        source: Source::Kept,
        outcome: Ok(certified),
    })
}

/// The goal configuration next to where the motion ends; none where its tip is farther from there than the end is moved.
fn goal_configuration(context: &RequestContext, followed: &Trajectory) -> Option<Configuration> {
    let (robot, end) = (&context.resources.robot, followed.end());
    let Goal::Tip(target) = &context.problem.goal else {
        return None;
    };
    if (robot.tip(&end) - target).norm() > FARTHEST {
        return None;
    }
    let (configuration, distance) = solve_tip(robot, target, &end);
    is_solved(distance).then_some(configuration)
}
