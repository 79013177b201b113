//! Paths whose ends are not exact yet: those of the paper's diffusion model, and given ones.

use crate::error::PlannerError;
use crate::goals::attach::attach;
use crate::goals::goal_configurations::check_goal;
use crate::models::diffusion::Task;
use crate::path::waypoints::Waypoints;
use crate::pipeline::context::{Drawn, Proposal, RequestContext};
use crate::plan::{Draw, Failure};
use crate::request::Guidance;
use crate::stage_times::StageTimes;
use codes::{Source, Stage};
use rayon::prelude::*;

/// Paths of the diffusion model; the goal configurations are the network's, and their tips are brought to the goal.
///
/// # Errors
/// [`PlannerError::Infeasible`] where no configuration reaches the goal.
pub(crate) fn draw(
    context: &RequestContext,
    guidance: Guidance,
    times: &mut StageTimes,
) -> Result<Drawn, PlannerError> {
    let (problem, request) = (context.problem, context.request);
    times.measure(Stage::Condition, || {
        check_goal(context.constraints.padded, problem, request.seed)
    })?;
    let task = Task {
        robot: &context.resources.robot,
        problem,
        guidance,
        seed: request.seed,
    };
    let model = context.resources.models.diffusion.as_ref();
    let sampled = model.map_or_else(Vec::new, |model| {
        times.measure(Stage::Sample, || {
            model.sample(&task, request.candidates, context.supervision.interrupt)
        })
    });
    Ok(deliver(context, sampled, times))
}

/// Makes motions of paths whose ends are not exact yet; a path is none where its drawing was truncated.
pub(super) fn deliver(
    context: &RequestContext,
    sampled: Vec<Option<Waypoints>>,
    times: &mut StageTimes,
) -> Drawn {
    let attached = times.measure(Stage::Correct, || attach_all(context, &sampled));
    let mut proposals = Vec::new();
    for (draw, path) in attached.iter().enumerate() {
        proposals.extend(path.as_ref().ok().map(|path| Proposal {
            draw: Some(draw),
            ..Proposal::of(path.clone(), Source::Learned)
        }));
    }
    let mut delivered = context.deliver_timed(proposals, times).into_iter();
    let draws = sampled
        .into_iter()
        .zip(attached)
        .map(|(sampled, attached)| {
            let delivered = attached.and_then(|_| delivered.next().ok_or(Failure::Truncated));
            let (path, outcome) = match delivered {
                Ok(draw) => (draw.path, draw.outcome),
                Err(failure) => (sampled.clone(), Err(failure)),
            };
            Draw {
                sampled,
                path,
                source: Source::Learned,
                outcome,
            }
        });
    draws.collect::<Vec<Draw>>().into()
}

/// Brings the ends of paths onto start and goal, or says why a path has no motion.
fn attach_all(
    context: &RequestContext,
    sampled: &[Option<Waypoints>],
) -> Vec<Result<Waypoints, Failure>> {
    let (robot, problem) = (&context.resources.robot, context.problem);
    let interrupt = context.supervision.interrupt;
    let bring = |sampled: &Option<Waypoints>| match sampled {
        Some(path) if !interrupt() => {
            let mut path = path.clone();
            let reached = attach(robot, problem, &mut path);
            reached.then_some(path).ok_or(Failure::Goal)
        }
        _ => Err(Failure::Truncated),
    };
    sampled.par_iter().map(bring).collect()
}
