//! A target that moves: the end of the motion that is followed is moved to it.

use crate::goals::inverse_kinematics::configuration_near;
use crate::pipeline::context::RequestContext;
use crate::plan::Draw;
use crate::problem::Goal;
use crate::request::EndToMove;
use crate::stage_times::StageTimes;
use codes::{Source, Stage};
use pcc_model::Configuration;
use trajectory::{MAX_KNOTS, Trajectory, limit_use};

/// Times within which the end is moved, s: the first one with which the motion keeps the limits counts. Moved within less, an end that
/// follows a target at 0.3 section lengths a second uses so much of the limits that it cannot be moved again soon.
const WITHIN_S: [f64; 5] = [0.42, 0.55, 0.71, 0.92, 1.26];
/// Farthest that a tip is moved, section lengths.
const FARTHEST: f64 = 0.15;
/// Least that an end is moved, rad. What is less is rounding: the target rests, and a faster motion to it is looked for.
const LEAST_RAD: f64 = 1e-7;
/// Relative amount by which a limit may be exceeded: the rounding of the measure.
const ROUNDING: f64 = 1e-9;

/// The motion that is followed with its end moved to the goal, where that is near and the motion is certified.
pub(super) fn draw(context: &RequestContext, times: &mut StageTimes) -> Option<Draw> {
    let EndToMove {
        remaining,
        most_knots,
    } = context.request.end_to_move.as_ref()?;
    let goal = times.measure(Stage::Condition, || goal_configuration(context, remaining))?;
    let by = goal - remaining.end();
    if by.norm() < LEAST_RAD {
        return None;
    }
    let start = &context.problem.start;
    let constraints = context.constraints.bending_no_more_than(start);
    let (tendons, limits) = (&constraints.robot.tendons, &constraints.limits);
    let may_be = |motion: &Trajectory| {
        motion.knots().len() <= MAX_KNOTS.min(*most_knots)
            && limit_use(motion, tendons, limits).largest() <= 1.0 + ROUNDING
    };
    let motion = times.measure(Stage::Time, || {
        let moved = |within_s: &f64| remaining.with_end_moved(&by, *within_s);
        WITHIN_S.iter().filter_map(moved).find(may_be)
    })?;
    let certified = times.measure(Stage::Certify, || constraints.certified(motion));
    Some(Draw {
        sampled: None,
        path: None,
        source: Source::MovedEnd,
        outcome: Ok(certified.ok()?),
    })
}

/// The goal configuration next to where the motion ends; none of a goal that is no tip, or is farther from there than the end is moved.
fn goal_configuration(context: &RequestContext, remaining: &Trajectory) -> Option<Configuration> {
    let (robot, end) = (&context.resources.robot, remaining.end());
    let goal = &context.problem.goal;
    let is_near =
        matches!(goal, Goal::Tip(target) if (robot.tip(&end) - target).norm() <= FARTHEST);
    is_near
        .then(|| configuration_near(robot, goal, &end))
        .flatten()
}
