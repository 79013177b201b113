//! `pcc evaluate`: one planner over the cases of a data set; `result.json` and `paths.npz`.

mod answer;
mod arguments;
mod arrays;
mod drawn_before;
mod given;
mod proposals;
mod summary;

pub(crate) use answer::Answer;
pub(crate) use arguments::Arguments;
pub(crate) use summary::machine;

use self::given::Given;
use crate::output_files::{make_writable, write_whole};
use crate::planner::{Loaded, load};
use crate::robot::unit_robot;
use crate::sampler::{PlannerName, name_of};
use anyhow::ensure;
use datasets::Case;
use indicatif::{ProgressBar, ProgressStyle};
use pcc_model::SECTIONS;
use planning::{Goal, MovingObstacles, Planner, PlannerError, Problem, Request, Sampler, Stage};
use rand_pcg::Pcg64;
use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use rivals::Query;
use std::iter;
use std::num::NonZero;
use std::panic::resume_unwind;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::Instant;

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let robot = unit_robot(&arguments.robot)?;
    let Loaded { planner, records } = load(
        arguments.planner,
        robot,
        &arguments.models,
        arguments.threads,
    )?;
    let (cases, given) = arguments.cases_and_given()?;
    make_writable(&arguments.out)?;
    let answers = answer_all(&planner, arguments, cases, given)?;
    arrays::write(
        &arguments.out.join("paths.npz"),
        &answers,
        arguments.candidates,
    )?;
    let result = summary::summarise(planner.robot(), arguments, records, &answers);
    let text = serde_json::to_string_pretty(&result)?;
    write_whole(&arguments.out.join("result.json"), &text)?;
    summary::print(&result);
    Ok(())
}

fn answer_all(
    planner: &Planner,
    arguments: &Arguments,
    cases: Vec<Case>,
    given: Option<Vec<Given>>,
) -> anyhow::Result<Vec<Answer>> {
    let style = ProgressStyle::with_template("{bar:40} {pos}/{len} cases, {eta} left")?;
    let bar = ProgressBar::new(cases.len() as u64).with_style(style);
    let mut given = given.map(Vec::into_iter);
    let asked = Asked {
        planner: arguments.planner,
        candidates: arguments.candidates,
        corrections: arguments.corrections,
    };
    let answer = |(index, case): (usize, Case)| {
        bar.inc(1);
        let seed = arguments.seed.wrapping_add(index as u64);
        let of_case = given.as_mut().and_then(Iterator::next);
        answer(planner, asked, seed, case, of_case)
    };
    let answers = cases.into_iter().enumerate().map(answer).collect();
    bar.finish_and_clear();
    answers
}

/// What a planner is asked for in every case.
#[derive(Clone, Copy)]
pub(crate) struct Asked {
    pub(crate) planner: PlannerName,
    pub(crate) candidates: usize,
    /// Corrections that a drawn path gets before it is given up.
    pub(crate) corrections: usize,
}

/// A planner's answer to a case, or to what was drawn for it.
pub(crate) fn answer(
    planner: &Planner,
    asked: Asked,
    seed: u64,
    case: Case,
    given: Option<Given>,
) -> anyhow::Result<Answer> {
    let (problem, request) = (problem_of(&case), request_of(asked, seed));
    let clock = Instant::now();
    let is_drawn_here = given.is_none() && asked.planner.sampler().is_none();
    let given = match given {
        Some(given) => Some(given),
        None => draw(asked.planner, planner, &case, &request)?,
    };
    let drawing_s = clock.elapsed().as_secs_f64();
    let (mut judged_from_s, mut polylines) = (None, Vec::new());
    let answered = match given {
        Some(Given::Paths(paths)) => {
            judged_from_s = is_drawn_here.then_some(drawing_s);
            planner.evaluate_paths(&problem, &request, paths, &|| false)
        }
        Some(Given::Polylines(drawn)) => {
            polylines.clone_from(&drawn);
            planner.follow_polylines(&problem, &request, drawn, &|| false)
        }
        None => planner.plan(&problem, &request, &|| false),
    };
    let plan = match answered {
        Ok(mut plan) => {
            if is_drawn_here {
                plan.stages[Stage::Sample] += drawing_s;
            }
            Ok(plan)
        }
        Err(PlannerError::Infeasible(reason)) => Err(reason),
        Err(other) => return Err(other.into()),
    };
    let seconds = clock.elapsed().as_secs_f64();
    Ok(Answer {
        case,
        plan,
        polylines,
        seconds,
        drawing_s: judged_from_s.unwrap_or(seconds),
    })
}

fn problem_of(case: &Case) -> Problem {
    Problem {
        start: case.start,
        goal: Goal::Tip(case.target_tip),
        scene: case.scene.clone(),
        moving: MovingObstacles::default(),
    }
}

fn request_of(asked: Asked, seed: u64) -> Request {
    Request {
        candidates: asked.candidates,
        seed,
        sampler: asked.planner.sampler().unwrap_or(Sampler::RrtSmooth),
        limits_scale: 1.0,
        padding: [0.0; SECTIONS],
        knots: 96,
        corrections: asked.corrections,
        start_motion: None,
        previous: None,
        end_to_move: None,
    }
}

/// What as many attempts of a rival as there are candidates come to; nothing where the planner has a sampler.
fn draw(
    name: PlannerName,
    planner: &Planner,
    case: &Case,
    request: &Request,
) -> anyhow::Result<Option<Given>> {
    let query = Query {
        robot: planner.robot(),
        balls: case.scene.balls(),
        start: case.start,
        target: case.target_tip,
    };
    let rng = |index| Pcg64::new(u128::from(request.seed), index as u128);
    match (name.rival(), name.anytime()) {
        (Some(rival), _) => {
            let indices = (0..request.candidates).into_par_iter();
            let attempt = |index| rival.attempt(&query, &mut rng(index));
            let paths = planner.install(|| indices.filter_map(attempt).collect());
            Ok(Some(Given::Paths(paths)))
        }
        (None, Some(anytime)) => {
            let attempt = |index| anytime.attempt(&query, &mut rng(index));
            let threads = planner.install(rayon::current_num_threads);
            let polylines = on_own_threads(threads, request.candidates, attempt)?;
            Ok(Some(Given::Polylines(polylines)))
        }
        (None, None) => {
            ensure!(
                name.sampler().is_some(),
                "{} draws no paths: they must be given",
                name_of(&name)
            );
            Ok(None)
        }
    }
}

/// What attempts by the clock come to, each in a pool of one worker: one of several would be given another attempt while it waits for its
/// fellows. No more at once than there are processors.
fn on_own_threads<T: Send>(
    threads: usize,
    count: usize,
    attempt: impl Fn(usize) -> Option<T> + Sync,
) -> anyhow::Result<Vec<T>> {
    let processors = thread::available_parallelism().map_or(1, NonZero::get);
    let next = AtomicUsize::new(0);
    let work = || -> Vec<(usize, T)> {
        let indices = iter::repeat_with(|| next.fetch_add(1, Ordering::Relaxed));
        let indices = indices.take_while(|index| *index < count);
        indices
            .filter_map(|index| Some((index, attempt(index)?)))
            .collect()
    };
    let pools =
        (0..threads.min(processors)).map(|_| ThreadPoolBuilder::new().num_threads(1).build());
    let pools: Vec<ThreadPool> = pools.collect::<Result<_, _>>()?;
    let mut found = thread::scope(|scope| {
        let workers = pools.iter().map(|pool| scope.spawn(|| pool.install(work)));
        let workers: Vec<_> = workers.collect();
        let done = workers
            .into_iter()
            .map(|it| it.join().unwrap_or_else(|panic| resume_unwind(panic)));
        done.flatten().collect::<Vec<_>>()
    });
    found.sort_by_key(|it| it.0);
    Ok(found.into_iter().map(|it| it.1).collect())
}
