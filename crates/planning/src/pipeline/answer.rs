//! The way of a request, top-down: goal configurations, paths of the sampler, motions.
//!
//! Everything is budgeted in counts, so the same request and seed give the same bits whatever the number of threads; an interrupt only
//! truncates.

use crate::error::PlannerError;
use crate::path::waypoints::Waypoints;
use crate::pipeline::braking::Braking;
use crate::pipeline::context::{Drawn, RequestContext};
use crate::pipeline::goal_set::{GoalSet, goal_set};
use crate::pipeline::{default, fast, straight_line, trees, whole_paths};
use crate::plan::{Candidate, Draw, Failure, Plan};
use crate::request::{Guidance, StartMotion, Supervision};
use crate::stage_times::StageTimes;
use codes::{Sampler, Source, Stage};

/// Answers a request.
///
/// # Errors
/// [`PlannerError::Infeasible`] where the goal cannot be reached or a robot in motion cannot stop.
pub(crate) fn answer(context: &RequestContext) -> Result<Plan, PlannerError> {
    match &context.request.start_motion {
        None => from_rest(context),
        Some(motion) => from_motion(context, motion),
    }
}

/// Answers a request whose robot rests at the start.
pub(super) fn from_rest(context: &RequestContext) -> Result<Plan, PlannerError> {
    let mut times = StageTimes::default();
    let (moving, padded) = (context.constraints.moving, context.constraints.padded);
    if moving.may_touch_at_once(padded, &context.problem.start) {
        return Ok(plan_of(undrawn(context, Failure::Collision), times));
    }
    let drawn = match context.request.sampler {
        Sampler::Default => to_goals(context, default::draw, &mut times)?,
        Sampler::Fast => to_goals(context, fast::draw, &mut times)?,
        Sampler::Straight | Sampler::StraightDrawn => {
            to_goals(context, straight_line::draw, &mut times)?
        }
        Sampler::RrtConnect | Sampler::RrtSmooth => to_goals(context, trees::draw, &mut times)?,
        Sampler::Diffusion => whole_paths::draw(context, Guidance::Pure, &mut times)?,
        Sampler::DiffusionPost => whole_paths::draw(context, Guidance::Post, &mut times)?,
        Sampler::DiffusionGuided => whole_paths::draw(context, Guidance::Guided, &mut times)?,
    };
    Ok(plan_of(drawn, times))
}

/// Finds goal configurations and lets a sampler draw paths to them.
fn to_goals(
    context: &RequestContext,
    draw: impl FnOnce(&RequestContext, &GoalSet, &mut StageTimes) -> Drawn,
    times: &mut StageTimes,
) -> Result<Drawn, PlannerError> {
    let goals = times.measure(Stage::Condition, || goal_set(context))?;
    if goals.distinct.is_empty() {
        return Ok(undrawn(context, Failure::Truncated));
    }
    Ok(draw(context, &goals, times))
}

/// Draws without paths: the interrupt left no time for goal configurations, or no motion can begin.
fn undrawn(context: &RequestContext, failure: Failure) -> Drawn {
    let source = match context.request.sampler {
        Sampler::Straight | Sampler::StraightDrawn => Source::StraightLine,
        Sampler::RrtConnect | Sampler::RrtSmooth => Source::Classical,
        _ => Source::Learned,
    };
    vec![Draw::unfinished(source, failure); context.request.candidates].into()
}

/// Plans from the configuration in which a moving robot can rest soonest; every motion begins with braking to it.
fn from_motion(context: &RequestContext, motion: &StartMotion) -> Result<Plan, PlannerError> {
    let RequestContext {
        problem,
        request,
        supervision,
        ..
    } = *context;
    let braking = Braking::new(&context.constraints, &motion.state_in(&problem.start))?;
    let (after, shorter) = braking.what_follows(problem, request);
    let report_whole = |candidate: Candidate| {
        if let Some(report) = supervision.certified {
            braking.candidate(&candidate).into_iter().for_each(report);
        }
    };
    let supervision = Supervision {
        certified: supervision.certified.is_some().then_some(&report_whole),
        ..supervision
    };
    let among_resting = context.constraints.moving.is_empty();
    let early = supervision.early_selection.filter(|_| among_resting);
    let padded = context.constraints.padded;
    let after = RequestContext::new(context.resources, padded, &after, &shorter, supervision);
    let plan = from_rest(&after)?;
    let straight = |end| straight_line::to(&after, &end);
    let later = early.and_then(|early| (early.begin)());
    let later = later.map(|state| Braking::new(&context.constraints, &state));
    let later = later.transpose()?;
    let braking = later.as_ref().unwrap_or(&braking);
    Ok(braking.plan(plan, straight, early.map(|early| early.selected)))
}

/// Answers a request with given paths (64 waypoints each, radians) in place of a sampler's.
pub(crate) fn answer_with_paths(context: &RequestContext, paths: Vec<Waypoints>) -> Plan {
    let mut times = StageTimes::default();
    let paths = paths.into_iter().map(Some).collect();
    let drawn = whole_paths::deliver(context, paths, &mut times);
    plan_of(drawn, times)
}

/// The plan of what was drawn: its certified candidates.
fn plan_of(drawn: Drawn, mut times: StageTimes) -> Plan {
    let Drawn {
        draws,
        learned: [learned_drawn, learned_certified],
        explored,
    } = drawn;
    let certified = draws.iter().enumerate().filter_map(|(index, draw)| {
        let motion = draw.outcome.as_ref().ok()?;
        Some(Candidate::of(index, draw.source, motion))
    });
    let candidates = times.measure(Stage::Select, || certified.collect());
    let truncated = draws
        .iter()
        .any(|d| d.outcome.as_ref().err() == Some(&Failure::Truncated));
    Plan {
        draws,
        candidates,
        learned_certified,
        learned_drawn,
        explored,
        truncated,
        stages: times,
    }
}
