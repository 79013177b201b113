//! The arguments of `pcc evaluate`, and the files that they name.

use super::drawn_before::{Records, Wanted};
use super::given::Given;
use super::proposals;
use crate::number;
use crate::planner::ModelArguments;
use crate::sampler::{PlannerName, name_of};
use anyhow::{Context, bail, ensure};
use clap::{Args, ValueEnum};
use datasets::{Case, Dataset, Split};
use pcc_model::Robot;
use planning::{MOST_CORRECTIONS, Waypoints};
use std::path::PathBuf;

#[derive(Clone, Copy, Debug, ValueEnum)]
pub(super) enum SplitName {
    Train,
    Validation,
    Test,
}

/// Arguments of `pcc evaluate`.
#[derive(Args)]
pub(crate) struct Arguments {
    /// Folder with dataset.npz and dataset_meta.json (authors' format, version 25).
    #[arg(long)]
    pub(super) dataset: PathBuf,
    /// Split whose cases are used.
    #[arg(long, value_enum, default_value = "test")]
    pub(super) split: SplitName,
    /// Planner to evaluate.
    #[arg(long, value_enum)]
    pub(super) planner: PlannerName,
    /// Archive for `--planner proposed`: `paths [C,S,64,6]`, radians, base frame, S paths for each of the first C cases; S is
    /// `--candidates`. Their ends need not be exact.
    #[arg(long)]
    proposals: Option<PathBuf>,
    /// Records of `pcc compare --out DIR`, for the planners that end by the clock (`rrt-star`, `bit-star`): what they drew there is followed
    /// again, and the time of the drawing is not measured. `--records DIR/cases/SET-PLANNER.jsonl` goes with `--dataset DIR/sets/SET-N`, all of
    /// its records' cases, and the same robot, seed and candidates.
    #[arg(long, conflicts_with = "proposals")]
    pub(super) records: Option<PathBuf>,
    /// Candidates a case (1 to 64).
    #[arg(long, default_value_t = 10, value_parser = number::candidates())]
    pub(super) candidates: usize,
    /// Seed (0 to 2^64 - 1); case i is planned with seed + i (modulo 2^64).
    #[arg(long, default_value_t = 0, value_parser = number::any())]
    pub(super) seed: u64,
    /// Only the first N cases, at least 1.
    #[arg(long, value_parser = number::whole(1, usize::MAX))]
    cases: Option<usize>,
    /// Worker threads of the planner, at most 256 (0: one a core).
    #[arg(long, default_value_t = 0, value_parser = number::threads())]
    pub(super) threads: usize,
    /// Corrections that a drawn path gets before it is given up (0 to 2).
    #[arg(long, default_value_t = MOST_CORRECTIONS, value_parser = number::whole(0, MOST_CORRECTIONS))]
    pub(super) corrections: usize,
    /// Robot file.
    #[arg(long, default_value = "config/robots/unit.toml")]
    pub(super) robot: PathBuf,
    #[command(flatten)]
    pub(super) models: ModelArguments,
    /// Folder for result.json and paths.npz.
    #[arg(long)]
    pub(super) out: PathBuf,
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

    /// The cases, and what was drawn before for each of them: the paths to judge if the planner is `proposed`, or what one that ends by the clock
    /// drew.
    pub(super) fn cases_and_given(&self) -> anyhow::Result<(Vec<Case>, Option<Vec<Given>>)> {
        if let Some(file) = &self.records {
            ensure!(
                self.planner.anytime().is_some(),
                "--records {} goes with planners that end by the clock: rrt-star and bit-star",
                file.display()
            );
            let records = Records::read(file).context("--records")?;
            let cases = self.cases(Some(records.count()))?;
            let wanted = Wanted {
                planner: name_of(&self.planner),
                candidates: self.candidates,
                seed: self.seed,
                robot_hash: Robot::from_file(&self.robot)?.hash(),
            };
            let given = records.given(&wanted, &cases).context("--records")?;
            return Ok((cases, Some(given)));
        }
        let proposals = self.proposals()?;
        let cases = self.cases(proposals.as_ref().map(Vec::len))?;
        let given = proposals.map(|paths| paths.into_iter().map(Given::Paths).collect());
        Ok((cases, given))
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
