//! The goal configurations of a request: those that a previous plan ended in, then others.

use crate::error::PlannerError;
use crate::goals::goal_configurations::goal_configurations_until;
use crate::pipeline::context::RequestContext;
use crate::pipeline::previous_plan::{RemainingPath, remaining_paths};
use pcc_model::Configuration;
use rand::SeedableRng;
use rand_pcg::Pcg64;

/// Goal configurations, and the paths to them that are known already.
pub(super) struct GoalSet {
    /// The goal configuration of each draw: the distinct ones in turn.
    pub(super) of_each_draw: Vec<Configuration>,
    /// The different configurations; none where the request was truncated before one was found.
    pub(super) distinct: Vec<Configuration>,
    /// What remains of a previous plan's paths, to the first of these configurations.
    pub(super) remaining: Vec<RemainingPath>,
}

impl GoalSet {
    /// One configuration for so many draws.
    pub(super) fn of_one(configuration: Configuration, draws: usize) -> Self {
        Self {
            of_each_draw: vec![configuration; draws],
            distinct: vec![configuration],
            remaining: Vec::new(),
        }
    }
}

/// Finds the goal configurations of a request, at most as many as it wants candidates.
///
/// # Errors
/// [`PlannerError::Infeasible`] where there is none.
pub(crate) fn goal_set(context: &RequestContext) -> Result<GoalSet, PlannerError> {
    let (robot, problem) = (context.constraints.padded, context.problem);
    let count = context.request.candidates;
    let previous = context.request.previous.as_deref();
    let remaining = previous.map_or_else(Vec::new, |p| remaining_paths(p, robot, problem, count));
    let mut distinct: Vec<Configuration> = remaining.iter().map(RemainingPath::end).collect();
    let mut rng = Pcg64::seed_from_u64(context.request.seed);
    let interrupt = context.supervision.interrupt;
    match goal_configurations_until(robot, problem, count, &mut rng, interrupt) {
        Ok(found) => add_distinct(&mut distinct, &found, count),
        Err(infeasible) if distinct.is_empty() => return Err(infeasible.into()),
        Err(_) => {}
    }
    Ok(GoalSet {
        of_each_draw: distinct.iter().cycle().take(count).copied().collect(),
        distinct,
        remaining,
    })
}

/// Adds configurations to `goals` until they are `count`: first those that are far from all of them, then nearer ones.
pub(super) fn add_distinct(goals: &mut Vec<Configuration>, found: &[Configuration], count: usize) {
    for separation_rad in [0.5, 0.1, 0.01] {
        for configuration in found {
            let is_new = goals
                .iter()
                .all(|goal| (goal - configuration).norm() >= separation_rad);
            if is_new && goals.len() < count {
                goals.push(*configuration);
            }
        }
    }
}
