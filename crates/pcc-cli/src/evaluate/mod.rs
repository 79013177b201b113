//! `pcc evaluate`: one planner over the cases of a data set; `result.json` and `paths.npz`.

mod arrays;
mod proposals;
mod summary;

use crate::number;
use crate::output_files::{make_writable, write_whole};
use crate::planner::{Loaded, ModelArguments, PlannerName, load, name_of};
use crate::robot::unit_robot;
use anyhow::{Context, bail};
use clap::{Args, ValueEnum};
use indicatif::{ProgressBar, ProgressStyle};
use pcc_model::SECTIONS;
use planning::dataset::{Case, Dataset, Split};
use planning::{
    Goal, Infeasible, MOST_CORRECTIONS, Plan, Planner, PlannerError, Problem, Request, Sampler,
    Selection, Waypoints,
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
    /// Archive for `--planner proposed`: `paths [C,S,64,6]`, radians, base frame, S paths for each of the first C cases; S is
    /// `--candidates`. Their ends need not be exact.
    #[arg(long)]
    proposals: Option<PathBuf>,
    /// Candidates a case (1 to 64).
    #[arg(long, default_value_t = 10, value_parser = number::candidates())]
    candidates: usize,
    /// Seed (0 to 2^64 - 1); case i is planned with seed + i (modulo 2^64).
    #[arg(long, default_value_t = 0, value_parser = number::any())]
    seed: u64,
    /// Only the first N cases, at least 1.
    #[arg(long, value_parser = number::cases())]
    cases: Option<usize>,
    /// Worker threads of the planner, at most 256 (0: one a core).
    #[arg(long, default_value_t = 0, value_parser = number::threads())]
    threads: usize,
    /// Corrections that a drawn path gets before it is given up (0 to 2).
    #[arg(long, default_value_t = MOST_CORRECTIONS, value_parser = number::corrections())]
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
    let robot = unit_robot(&arguments.robot)?;
    let Loaded { planner, records } = load(
        arguments.planner,
        &robot,
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

impl Arguments {
    /// The cases asked for, no more than paths are given for.
    fn cases(&self, given: Option<usize>) -> anyhow::Result<Vec<Case>> {
        let split = match self.split {
            SplitName::Train => Split::Train,
            SplitName::Validation => Split::Validation,
            SplitName::Test => Split::Test,
        };
        let limit = self.cases.into_iter().chain(given).min();
        let cases = Dataset::read(&self.dataset)
            .and_then(|dataset| dataset.cases(split, limit))
            .with_context(|| format!("data set {}", self.dataset.display()))?;
        let needed = given.and(limit).unwrap_or(1);
        let split = name_of(&self.split);
        match (&self.proposals, given) {
            (Some(file), Some(given)) if cases.len() < needed => bail!(
                "array `paths` of {} is for {given} cases; at most {}, as many as {} has in split {split}, are allowed",
                file.display(),
                cases.len(),
                self.dataset.display()
            ),
            _ if cases.len() < needed => bail!(
                "{} has {} cases in split {split}, at least {needed} are needed",
                self.dataset.display(),
                cases.len()
            ),
            _ => Ok(cases),
        }
    }

    /// The paths to judge, case by case, if the planner is `proposed`.
    fn proposals(&self) -> anyhow::Result<Option<Vec<Vec<Waypoints>>>> {
        match (self.planner, &self.proposals) {
            (PlannerName::Proposed, Some(file)) => proposals::read(file, self.candidates)
                .map(Some)
                .context("--proposals"),
            (PlannerName::Proposed, None) => bail!("--planner proposed needs --proposals FILE"),
            (_, Some(file)) => bail!(
                "--proposals {} goes with --planner proposed",
                file.display()
            ),
            (_, None) => Ok(None),
        }
    }
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
    };
    let request = Request {
        candidates: arguments.candidates,
        seed,
        sampler: arguments.planner.sampler().unwrap_or(Sampler::Straight),
        selection: Selection::ShortestTime,
        limits_scale: 1.0,
        growth: [0.0; SECTIONS],
        knots: 96,
        corrections: arguments.corrections,
        start_motion: None,
        previous: None,
    };
    let clock = Instant::now();
    let answered = match given {
        Some(paths) => planner.judge(&problem, &request, paths, &|| false),
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
