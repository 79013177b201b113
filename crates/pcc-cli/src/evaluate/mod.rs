//! `pcc evaluate`: one planner over the cases of a data set; `result.json` and `paths.npz`.

mod answer;
mod arguments;
mod arrays;
mod proposals;
mod summary;

pub(crate) use arguments::Arguments;

use self::answer::Answer;
use crate::output_files::{make_writable, write_whole};
use crate::planner::{Loaded, load};
use crate::robot::unit_robot;
use datasets::Case;
use indicatif::{ProgressBar, ProgressStyle};
use pcc_model::SECTIONS;
use planning::{
    Goal, MovingObstacles, Planner, PlannerError, Problem, Request, Sampler, Waypoints,
};
use std::time::Instant;

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let robot = unit_robot(&arguments.robot)?;
    let Loaded { planner, records } = load(
        arguments.planner,
        robot,
        &arguments.models,
        arguments.threads,
    )?;
    let proposals = arguments.proposals()?;
    let cases = arguments.cases(proposals.as_ref().map(Vec::len))?;
    make_writable(&arguments.out)?;
    let answers = answer_all(&planner, arguments, cases, proposals)?;
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
    proposals: Option<Vec<Vec<Waypoints>>>,
) -> anyhow::Result<Vec<Answer>> {
    let style = ProgressStyle::with_template("{bar:40} {pos}/{len} cases, {eta} left")?;
    let bar = ProgressBar::new(cases.len() as u64).with_style(style);
    let mut proposals = proposals.map(Vec::into_iter);
    let answer = |(index, case): (usize, Case)| {
        bar.inc(1);
        let seed = arguments.seed.wrapping_add(index as u64);
        let given = proposals.as_mut().and_then(Iterator::next);
        answer(planner, arguments, seed, case, given)
    };
    let answers = cases.into_iter().enumerate().map(answer).collect();
    bar.finish_and_clear();
    answers
}

fn answer(
    planner: &Planner,
    arguments: &Arguments,
    seed: u64,
    case: Case,
    given: Option<Vec<Waypoints>>,
) -> anyhow::Result<Answer> {
    let problem = Problem {
        start: case.start,
        goal: Goal::Tip(case.target_tip),
        scene: case.scene.clone(),
        moving: MovingObstacles::default(),
    };
    let request = Request {
        candidates: arguments.candidates,
        seed,
        sampler: arguments.planner.sampler().unwrap_or(Sampler::Straight),
        limits_scale: 1.0,
        padding: [0.0; SECTIONS],
        knots: 96,
        corrections: arguments.corrections,
        start_motion: None,
        previous: None,
    };
    let clock = Instant::now();
    let answered = match given {
        Some(paths) => planner.evaluate_paths(&problem, &request, paths, &|| false),
        None => planner.plan(&problem, &request, &|| false),
    };
    let plan = match answered {
        Ok(plan) => Ok(plan),
        Err(PlannerError::Infeasible(reason)) => Err(reason),
        Err(other) => return Err(other.into()),
    };
    Ok(Answer {
        case,
        plan,
        seconds: clock.elapsed().as_secs_f64(),
    })
}
