//! The way of a request, top-down: goal configurations, paths of the sampler, motions.
//!
//! Everything is budgeted in counts, so the same request and seed give the same bits whatever the number of threads; an interrupt only
//! truncates.

use crate::error::PlannerError;
use crate::path::waypoints::Waypoints;
use crate::pipeline::braking::Braking;
use crate::pipeline::context::{Drawn, RequestContext};
use crate::pipeline::goal_set::{GoalSet, goal_set};
use crate::pipeline::joined_plan::Late;
use crate::pipeline::joining::Joining;
use crate::pipeline::previous_plan::kept_path;
use crate::pipeline::segments::JoinedSegments;
use crate::pipeline::{default, fast, moved_end, straight_line, trees, whole_paths};
use crate::plan::{Candidate, Draw, Failure, Plan};
use crate::request::{EarlySelection, Guidance, StartMotion, Supervision, ToBeDone, Told};
use crate::stage_times::StageTimes;
use codes::{Sampler, Source, Stage};
use pcc_model::Configuration;
use std::cell::OnceCell;

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
    Ok(to_these(context, &goals, draw, times))
}

/// Lets a sampler draw paths to these goal configurations.
fn to_these(
    context: &RequestContext,
    goals: &GoalSet,
    draw: impl FnOnce(&RequestContext, &GoalSet, &mut StageTimes) -> Drawn,
    times: &mut StageTimes,
) -> Drawn {
    if goals.distinct.is_empty() {
        return undrawn(context, Failure::Truncated);
    }
    draw(context, goals, times)
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

/// Moves the end of the motion that is followed, where the request wants that and it can be, or plans anew.
fn from_motion(context: &RequestContext, motion: &StartMotion) -> Result<Plan, PlannerError> {
    let mut times = StageTimes::default();
    if let Some(draw) = moved_end::draw(context, &mut times) {
        return Ok(plan_of(vec![draw].into(), times));
    }
    let mut plan = after_braking(context, motion)?;
    plan.stages.add(1.0, &times);
    Ok(plan)
}

/// Plans from the configuration in which a moving robot can rest soonest; every motion begins with braking to it.
fn after_braking(context: &RequestContext, motion: &StartMotion) -> Result<Plan, PlannerError> {
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
    let padded = context.constraints.padded;
    let after = RequestContext::new(context.resources, padded, &after, &shorter, supervision)
        .with_bending_slack(braking.bending_slack_rad());
    let is_afresh = request.sampler == Sampler::Default
        && request.previous.is_none()
        && context.constraints.moving.is_empty();
    let anew = |braking: &Braking, end: &Configuration| fastest_to(context, braking, end);
    let joining = Joining {
        braking: &braking,
        anew: is_afresh.then_some(&anew),
    };
    if !context.constraints.moving.is_empty() {
        return Ok(joining.plan(from_rest(&after)?, JoinedSegments::default(), None));
    }
    let SegmentsFirst {
        plan,
        segments,
        later,
    } = segments_first(context, &joining, &after)?;
    let early = supervision.early_selection;
    let late = early.filter(|_| segments.selected().is_none());
    let [joining_all, joining_again] = match joining.expects_planning_paths_anew(&plan) {
        true => [
            ToBeDone::JoiningAndPlanningAnew,
            ToBeDone::PathAgainAndPlanningAnew,
        ],
        false => [ToBeDone::Joining, ToBeDone::PathAgain],
    };
    let latest = late.and_then(|late| braking_later(context, late, joining_all));
    let (braking, segments) = match (&latest, &later) {
        (Some(latest), _) => (latest, JoinedSegments::default()),
        (None, Some(later)) => (later, segments),
        (None, None) => (&braking, segments),
    };
    let joining = joining.to_braking(braking);
    let later = || braking_later(context, late?, joining_again);
    let late = late.map(|late| Late {
        braking: &later,
        selected: late.selected,
    });
    Ok(joining.plan(plan, segments, late))
}

/// A plan from rest, and segments that were joined before it was made.
struct SegmentsFirst<'a> {
    plan: Plan,
    segments: JoinedSegments,
    /// What the segments are joined to, where that is not what the request says.
    later: Option<Braking<'a>>,
}

/// Segments, and what they are joined to, where that is not what the request says.
type SegmentsLater<'a> = (JoinedSegments, Option<Braking<'a>>);

/// The fastest of as many candidates as are asked for, planned by the default sampler from where a robot rests after braking to one goal
/// configuration alone.
fn fastest_to(context: &RequestContext, braking: &Braking, end: &Configuration) -> Option<Draw> {
    let (after, shorter) = braking.what_follows(context.problem, context.request);
    let padded = context.constraints.padded;
    let untold = Supervision::new(context.supervision.interrupt);
    let after = RequestContext::new(context.resources, padded, &after, &shorter, untold)
        .with_bending_slack(braking.bending_slack_rad());
    let goals = GoalSet::of_one(*end, shorter.candidates);
    let draws = default::draw(&after, &goals, &mut StageTimes::default()).draws;
    draws
        .into_iter()
        .min_by(|a, b| a.duration_s().total_cmp(&b.duration_s()))
}

/// Braking from the later state in which the motions are to begin, where the robot can brake there.
fn braking_later<'a>(
    context: &RequestContext<'a>,
    early: EarlySelection,
    to_be_done: ToBeDone,
) -> Option<Braking<'a>> {
    let later = OnceCell::new();
    (early.begin)(to_be_done, &|state| {
        let braking = Braking::new(&context.constraints, state);
        braking.is_ok_and(|braking| later.set(braking).is_ok())
    });
    later.into_inner()
}

/// Plans from where a robot in motion can rest among obstacles that rest; before the default sampler draws paths, segments, pushed where they
/// must be, are joined, of which the fastest motion mostly is one and is told as soon as it is known. What remains of a motion that is followed
/// is to be compared with all.
fn segments_first<'a>(
    context: &RequestContext<'a>,
    joining: &Joining,
    after: &RequestContext,
) -> Result<SegmentsFirst<'a>, PlannerError> {
    if after.request.sampler != Sampler::Default {
        return Ok(SegmentsFirst {
            plan: from_rest(after)?,
            segments: JoinedSegments::default(),
            later: None,
        });
    }
    let mut times = StageTimes::default();
    let goals = times.measure(Stage::Condition, || goal_set(after))?;
    let segments = match kept_path(&goals.remaining) {
        Some(_) => JoinedSegments::default(),
        None => times.measure(Stage::Select, || joining.segments(&goals.distinct)),
    };
    let (segments, later) = times.measure(Stage::Select, || {
        settled(context, joining, segments, &goals.distinct)
    });
    let tell = || told(context, joining, (segments, later), &goals.distinct);
    let draw = || to_these(after, &goals, default::draw, &mut times);
    let ((segments, later), drawn) = rayon::join(tell, draw);
    Ok(SegmentsFirst {
        plan: plan_of(drawn, times),
        segments,
        later,
    })
}

/// The segments with their fastest motion as it is executed, where that is the fastest of the request: planned anew where it may be later than
/// after a stop, and joined to the braking that is returned, where the motion that is left could not be left as soon as the request says.
fn settled<'a>(
    context: &RequestContext<'a>,
    joining: &Joining,
    segments: JoinedSegments,
    goals: &[Configuration],
) -> SegmentsLater<'a> {
    let early = context.supervision.early_selection;
    let early = early.filter(|_| segments.selected().is_some());
    let later = |to_be_done| early.and_then(|early| braking_later(context, early, to_be_done));
    let first = later(match joining.expects_planning_anew(&segments) {
        true => ToBeDone::PlanningAnew,
        false => joining.work_again(&segments),
    });
    let segments = match &first {
        None => joining.with_fastest_improved(segments),
        Some(braking) => joining.to_braking(braking).fastest_again(&segments, goals),
    };
    let asked = segments.selected().map(|_| joining.work_again(&segments));
    let Some(second) = asked.and_then(later) else {
        return (segments, first);
    };
    let segments = joining.to_braking(&second).fastest_again(&segments, goals);
    (segments, Some(second))
}

/// Tells the fastest of the segments, and while it comes too late, joins it to a later braking and tells it again; what was told last.
fn told<'a>(
    context: &RequestContext<'a>,
    joining: &Joining,
    (mut segments, mut later): SegmentsLater<'a>,
    goals: &[Configuration],
) -> SegmentsLater<'a> {
    let Some(early) = context.supervision.early_selection else {
        return (segments, later);
    };
    while let Some(fastest) = segments.selected()
        && (early.selected)(fastest.clone()) == Told::TooLate
        && let Some(braking) = braking_later(context, early, joining.work_again(&segments))
    {
        segments = joining.to_braking(&braking).fastest_again(&segments, goals);
        later = Some(braking);
    }
    (segments, later)
}

/// Answers a request with given paths (64 waypoints each, radians) in place of a sampler's.
pub(crate) fn answer_with_paths(context: &RequestContext, paths: Vec<Waypoints>) -> Plan {
    let mut times = StageTimes::default();
    let paths = paths.into_iter().map(Some).collect();
    let drawn = whole_paths::deliver(context, paths, &mut times);
    plan_of(drawn, times)
}

/// Answers a request with polylines of certified edges (radians) in place of a tree's.
pub(crate) fn answer_with_polylines(
    context: &RequestContext,
    polylines: Vec<Vec<Configuration>>,
) -> Plan {
    let mut times = StageTimes::default();
    let drawn = trees::follow_all(context, polylines, &mut times);
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
