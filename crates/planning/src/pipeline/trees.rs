//! Motions by RRT-Connect: a tree to each goal configuration, or a first motion to any of them.

use crate::motion::constraints::MotionConstraints;
use crate::path::waypoints::resample;
use crate::pipeline::context::{Drawn, RequestContext};
use crate::pipeline::goal_set::GoalSet;
use crate::plan::{Draw, Failure};
use crate::request::Interrupt;
use crate::search::edges::{RrtSettings, Search};
use crate::search::first_success::first_success;
use crate::search::portfolio::{PORTFOLIO_BUDGET, search_portfolio};
use crate::stage_times::StageTimes;
use codes::{Sampler, Source, Stage};
use collision::Scene;
use pcc_model::Configuration;
use rand_pcg::Pcg64;
use rayon::prelude::*;
use std::iter::once_with;

/// Room beside the padded tubes in a tree's attempts, section lengths: rounding its corners needs some, a narrow passage may not have it.
const TREE_MARGINS: [f64; 3] = [0.04, 0.01, 0.0];
/// Room beside the padded tubes where any path at all is sought, section lengths: more than the error of a clearance.
pub(super) const LEAST_MARGIN: f64 = 1e-3;
/// Time for which moving balls are avoided wherever they pass, in least durations of the longest straight segment.
const LONGER: f64 = 1.5;
/// Times that a path that was found is shortened again because it has too many corners for a motion.
const SHORTENINGS: usize = 3;

/// One tree for each draw, all at once.
pub(crate) fn draw(context: &RequestContext, goals: &GoalSet, times: &mut StageTimes) -> Drawn {
    let draws = |context: &RequestContext| -> Vec<Draw> {
        let goals = goals.of_each_draw.par_iter().with_max_len(1).enumerate();
        let draws = goals.map(|(i, goal)| {
            let draw = tree(context, i, goal, context.supervision.interrupt);
            context.report(i, &draw);
            draw
        });
        draws.collect()
    };
    let draws = times.measure(Stage::Sample, || {
        let mut drawn = draws(context);
        if context.constraints.moving.is_empty() {
            return drawn;
        }
        let swept = swept_scene(context, goals);
        let beside = draws(&context.among(&swept));
        for (draw, beside) in drawn.iter_mut().zip(beside) {
            if beside.duration_s() < draw.duration_s() {
                *draw = beside;
            }
        }
        drawn
    });
    draws.into()
}

/// The obstacles at rest, and balls that cover all the way of those that move while a motion along the segment to the farthest goal
/// configuration may last.
fn swept_scene(context: &RequestContext, goals: &GoalSet) -> Scene {
    let constraints = &context.constraints;
    let start = context.problem.start;
    let least_s = |goal: &Configuration| constraints.least_duration_s(&[start, *goal]);
    let longest_s = goals.distinct.iter().map(least_s).fold(0.0, f64::max);
    let moving = constraints.moving;
    moving.swept_into(
        &context.problem.scene,
        constraints.padded,
        LONGER * longest_s,
    )
}

/// A first motion, and the place of the goal configuration that it reaches; where [`motion_to_any`] finds none, one of the trees of
/// [`draw`]. Among moving balls [`motion_to_any`] alone seeks one, beside all of these balls' ways, then among the obstacles at rest.
pub(super) fn first_motion(context: &RequestContext, goals: &GoalSet) -> Option<(usize, Draw)> {
    if !context.constraints.moving.is_empty() {
        let swept = swept_scene(context, goals);
        return motion_to_any(&context.among(&swept), &goals.distinct)
            .or_else(|| motion_to_any(context, &goals.distinct));
    }
    motion_to_any(context, &goals.distinct).or_else(|| {
        let goals = &goals.of_each_draw;
        let interrupt = context.supervision.interrupt;
        first_success(goals.len(), interrupt, |i, interrupt| {
            let draw = tree(context, i, &goals[i], interrupt);
            draw.outcome.is_ok().then_some((i, draw))
        })
    })
}

/// A motion to some goal configuration, by trees that begin in all of them, and the place of that configuration.
fn motion_to_any(context: &RequestContext, goals: &[Configuration]) -> Option<(usize, Draw)> {
    let padded = context.padded_by(LEAST_MARGIN);
    let search = context.search(&padded, &PORTFOLIO_BUDGET, context.supervision.interrupt);
    let rng = |number| context.tree_rng(context.request.candidates + number);
    let (polyline, mut rng) = search_portfolio(&search, &context.problem.start, goals, rng)?;
    let reached = goals
        .iter()
        .position(|goal| Some(goal) == polyline.last())?;
    let polyline = search.shorten(polyline, &mut rng);
    let mut draw = Draw::unfinished(Source::Classical, Failure::NoPath);
    follow_ever_shorter(context, &search, polyline, rng, &mut draw).then_some((reached, draw))
}

/// The draw with this number by a tree to its goal configuration, with less room in each attempt.
fn tree(
    context: &RequestContext,
    index: usize,
    goal: &Configuration,
    interrupt: Interrupt,
) -> Draw {
    let mut draw = Draw::unfinished(Source::Classical, Failure::NoPath);
    let mut rng = context.tree_rng(index);
    let settings = RrtSettings::default();
    for margin in TREE_MARGINS {
        if interrupt() {
            break;
        }
        let padded = context.padded_by(margin);
        let search = context.search(&padded, &settings, interrupt);
        if let Some(polyline) = search.connect(&context.problem.start, &[*goal], &mut rng)
            && follow(context, &search, &polyline, &mut draw)
        {
            return draw;
        }
    }
    context.note_truncation(&mut draw);
    draw
}

/// A motion along each of these polylines from the start to a goal configuration, which a search found on certified edges: shortened, with as
/// much room as all of its edges have, as the paths of trees are.
pub(super) fn follow_all(
    context: &RequestContext,
    polylines: Vec<Vec<Configuration>>,
    times: &mut StageTimes,
) -> Drawn {
    let polylines = polylines.into_par_iter().with_max_len(1).enumerate();
    let draws: Vec<Draw> = times.measure(Stage::Correct, || {
        let followed = polylines.map(|(index, polyline)| follow_found(context, index, &polyline));
        followed.collect()
    });
    draws.into()
}

/// The draw with this number along a polyline.
fn follow_found(context: &RequestContext, index: usize, polyline: &[Configuration]) -> Draw {
    let mut draw = Draw::unfinished(Source::Classical, Failure::NoPath);
    let mut rng = context.tree_rng(index);
    let settings = RrtSettings::default();
    for margin in TREE_MARGINS {
        let padded = context.padded_by(margin);
        let search = context.search(&padded, &settings, context.supervision.interrupt);
        let is_free = |edge: &[Configuration]| search.edge_is_free(&edge[0], &edge[1]);
        if polyline.windows(2).all(is_free) {
            let shorter = search.shorten(polyline.to_vec(), &mut rng);
            if follow_ever_shorter(context, &search, shorter, rng.clone(), &mut draw) {
                break;
            }
        }
    }
    context.note_truncation(&mut draw);
    draw
}

/// Makes a motion of a polyline, which is shortened again where it has too many corners for that; whether there is one.
pub(super) fn follow_ever_shorter(
    context: &RequestContext,
    search: &Search,
    mut polyline: Vec<Configuration>,
    mut rng: Pcg64,
    draw: &mut Draw,
) -> bool {
    for _ in 0..=SHORTENINGS {
        if follow(context, search, &polyline, draw) {
            return true;
        }
        let shorter = search.shorten(polyline.clone(), &mut rng);
        if shorter == polyline || (search.interrupt)() {
            break;
        }
        polyline = shorter;
    }
    false
}

/// Makes a motion of a polyline that a search certified; whether it can be timed and certified.
///
/// The sampler `rrt-connect` keeps to the polyline and rounds its corners as is usual; `rrt-smooth` first treats this rounded path as a
/// learned one, and others seek a smooth path beside the polyline. The search's interrupt holds for all of it.
fn follow(
    context: &RequestContext,
    search: &Search,
    polyline: &[Configuration],
    draw: &mut Draw,
) -> bool {
    let constraints = MotionConstraints {
        interrupt: search.interrupt,
        ..context.constraints
    };
    let rounded = || resample(&search.round(polyline));
    let smooth = match context.request.sampler {
        Sampler::RrtConnect => None,
        Sampler::RrtSmooth => constraints.like_a_learned_path(rounded()),
        _ => constraints.beside(polyline),
    };
    let followed = smooth.or_else(|| {
        let paths = once_with(rounded).chain(once_with(|| resample(polyline)));
        constraints.along(polyline, paths)
    });
    let Some((path, certified)) = followed else {
        return false;
    };
    draw.path = Some(path);
    draw.outcome = Ok(certified);
    true
}
