//! `pcc evaluate`: one planner over the cases of a data set; `result.json` and `paths.npz`.

mod arrays;
mod summary;

use crate::dataset::unit_robot;
use crate::number::threads;
use crate::planner::{Loaded, ModelArguments, PlannerName, load, name_of};
use anyhow::{Context, bail};
use clap::{Args, ValueEnum, builder::RangedU64ValueParser};
use indicatif::{ProgressBar, ProgressStyle};
use planning::dataset::{Case, Dataset, Split};
use planning::{
    Goal, Infeasible, MOST_CORRECTIONS, Plan, Planner, PlannerError, Problem, Request, Selection,
};
use std::path::PathBuf;
use std::time::Instant;

#[derive(Clone, Copy, Debug, ValueEnum)]
enum SplitName {
    Train,
    Validation,
    Test,
}

/// Arguments of `pcc evaluate`.
#[derive(Args)]
pub(crate) struct Arguments {
    /// Folder with dataset.npz and dataset_meta.json (authors' format, version 25).
    #[arg(long)]
    dataset: PathBuf,
    /// Split whose cases are used.
    #[arg(long, value_enum, default_value = "test")]
    split: SplitName,
    /// Planner to evaluate.
    #[arg(long, value_enum)]
    planner: PlannerName,
    /// Candidates a case (1 to 64).
    #[arg(long, default_value_t = 10)]
    candidates: usize,
    /// Seed; case i is planned with seed + i.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Only the first N cases, at least 1.
    #[arg(long, value_parser = RangedU64ValueParser::<usize>::new().range(1..))]
    cases: Option<usize>,
    /// Worker threads of the planner, at most 256 (0: one a core).
    #[arg(long, default_value_t = 0, value_parser = threads())]
    threads: usize,
    /// Corrections that a drawn path gets before it is given up (0 to 2).
    #[arg(long, default_value_t = MOST_CORRECTIONS,
        value_parser = RangedU64ValueParser::<usize>::new().range(0..=MOST_CORRECTIONS as u64))]
    corrections: usize,
    /// Robot file.
    #[arg(long, default_value = "config/robots/unit.toml")]
    robot: PathBuf,
    #[command(flatten)]
    models: ModelArguments,
    /// Folder for result.json and paths.npz.
    #[arg(long)]
    out: PathBuf,
}

/// A case and what the planner answered.
pub(crate) struct Answer {
    pub(crate) case: Case,
    pub(crate) plan: Result<Plan, Infeasible>,
    pub(crate) seconds: f64,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    if !(1..=64).contains(&arguments.candidates) {
        bail!("--candidates {}: 1 to 64 are allowed", arguments.candidates);
    }
    let robot = unit_robot(&arguments.robot)?;
    let Loaded { planner, diffusion } = load(
        arguments.planner,
        &robot,
        &arguments.models,
        arguments.threads,
    )?;
    let dataset = Dataset::read(&arguments.dataset)?;
    let split = match arguments.split {
        SplitName::Train => Split::Train,
        SplitName::Validation => Split::Validation,
        SplitName::Test => Split::Test,
    };
    let cases = dataset.cases(split, arguments.cases)?;
    if cases.is_empty() {
        bail!(
            "{} has no case in split {}",
            arguments.dataset.display(),
            name_of(&arguments.split)
        );
    }
    std::fs::create_dir_all(&arguments.out)
        .with_context(|| format!("cannot make {}", arguments.out.display()))?;
    let answers = answer_all(&planner, arguments, cases)?;
    arrays::write(
        &arguments.out.join("paths.npz"),
        &answers,
        arguments.candidates,
    )?;
    let result = summary::summarise(planner.robot(), arguments, diffusion, &answers);
    std::fs::write(
        arguments.out.join("result.json"),
        serde_json::to_string_pretty(&result)?,
    )?;
    summary::print(&result);
    Ok(())
}

fn answer_all(
    planner: &Planner,
    arguments: &Arguments,
    cases: Vec<Case>,
) -> anyhow::Result<Vec<Answer>> {
    let style = ProgressStyle::with_template("{bar:40} {pos}/{len} cases, {eta} left")?;
    let bar = ProgressBar::new(cases.len() as u64).with_style(style);
    let answer = |(index, case): (usize, Case)| {
        bar.inc(1);
        let seed = arguments.seed.wrapping_add(index as u64);
        answer(planner, arguments, seed, case)
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
) -> anyhow::Result<Answer> {
    let problem = Problem {
        start: case.start,
        goal: Goal::Tip(case.target_tip),
        scene: case.scene.clone(),
    };
    let request = Request {
        candidates: arguments.candidates,
        seed,
        sampler: arguments.planner.sampler(),
        selection: Selection::ShortestTime,
        limits_scale: 1.0,
        growth: 0.0,
        knots: 96,
        corrections: arguments.corrections,
        previous: None,
    };
    let clock = Instant::now();
    let plan = match planner.plan(&problem, &request, &|| false) {
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
