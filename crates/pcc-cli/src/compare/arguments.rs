//! The arguments of `pcc compare`.

use super::case_sets::{CaseSet, file_name};
use super::figure_name::FigureName;
use crate::number;
use crate::planner::ModelArguments;
use crate::sampler::{PlannerName, name_of};
use anyhow::{bail, ensure};
use clap::{Args, ValueEnum};
use std::collections::BTreeSet;
use std::path::PathBuf;

/// Cases of each set, without and with `--quick`.
const CASES: [usize; 2] = [250, 30];
const MOST_CASES: usize = 1_000_000;
/// Minutes that the whole page took on two cores of several machines, without and with `--quick`.
const MINUTES: [&str; 2] = ["18 to 23", "4"];

/// Arguments of `pcc compare`.
#[derive(Args)]
pub(crate) struct Arguments {
    /// Planners to compare, separated by commas, and nothing but the comparison; without it all but `proposed`.
    #[arg(long, value_enum, value_delimiter = ',')]
    planners: Vec<PlannerName>,
    /// Sets of cases, separated by commas: reference, general and hard, which are generated from seeds that nothing was trained with, or
    /// folders with a data set, and nothing but the comparison; without it those three.
    #[arg(long, value_delimiter = ',')]
    sets: Vec<CaseSet>,
    /// Figures of the page, separated by commas, and nothing but these; all of them where none of --figures, --planners and --sets is given.
    #[arg(long, value_enum, value_delimiter = ',', conflicts_with_all = ["planners", "sets"])]
    figures: Vec<FigureName>,
    /// Cases of each set (2 to 1000000); without it 250, with --quick 30.
    #[arg(long, value_parser = number::whole(2, MOST_CASES))]
    cases: Option<usize>,
    /// The whole page at a reduced size.
    #[arg(long)]
    pub(super) quick: bool,
    /// Candidates, or attempts, a case (1 to 64).
    #[arg(long, default_value_t = 10, value_parser = number::candidates())]
    pub(super) candidates: usize,
    /// Seed (0 to 2^64 - 1); case i is planned with seed + i (modulo 2^64).
    #[arg(long, default_value_t = 0, value_parser = number::any())]
    pub(super) seed: u64,
    /// Planner that the others are paired with, case by case: one of those that are compared.
    #[arg(long, value_enum, default_value = "fast")]
    pub(super) against: PlannerName,
    /// Worker threads of the planners, at most 256 (0: one a core).
    #[arg(long, default_value_t = 0, value_parser = number::threads())]
    pub(super) threads: usize,
    /// Robot file.
    #[arg(long, default_value = "config/robots/unit.toml")]
    pub(super) robot: PathBuf,
    #[command(flatten)]
    pub(super) models: ModelArguments,
    /// Folder for compare.json, compare.csv and index.html; what the same programs have left in it of the same robot, weights, cases and
    /// options is neither planned nor executed again, and what is of others is refused.
    #[arg(long)]
    pub(super) out: PathBuf,
}

impl Arguments {
    /// Refuses options that are each allowed, but not together.
    pub(super) fn check(&self) -> anyhow::Result<()> {
        let planners: Vec<String> = self.planners().iter().map(name_of).collect();
        let sets = self.sets();
        let files = sets.iter().map(|set| file_name(&set.to_string()));
        let files: Vec<String> = files.collect();
        let figures: Vec<String> = self.figures.iter().map(name_of).collect();
        for (option, names) in [
            ("--planners", &planners),
            ("--sets", &files),
            ("--figures", &figures),
        ] {
            if let Some(name) = named_twice(names) {
                bail!("{option} has {name} twice: each name may be there once");
            }
        }
        let proposed = name_of(&PlannerName::Proposed);
        ensure!(
            !planners.contains(&proposed),
            "--planners has {proposed}, whose paths are another program's: pcc evaluate takes them"
        );
        let against = name_of(&self.against);
        ensure!(
            planners.contains(&against),
            "--against {against} is none of the planners that are compared: {}",
            planners.join(", ")
        );
        Ok(())
    }

    pub(super) fn planners(&self) -> Vec<PlannerName> {
        let all = PlannerName::value_variants().iter().copied();
        match self.planners.is_empty() {
            true => all.filter(|name| *name != PlannerName::Proposed).collect(),
            false => self.planners.clone(),
        }
    }

    pub(super) fn sets(&self) -> Vec<CaseSet> {
        match self.sets.is_empty() {
            _ if !self.figures.is_empty() => Vec::new(),
            true => CaseSet::COMPARED.to_vec(),
            false => self.sets.clone(),
        }
    }

    pub(super) fn figures(&self) -> Vec<FigureName> {
        match self.is_whole_page() {
            true => FigureName::value_variants().to_vec(),
            false => self.figures.clone(),
        }
    }

    /// Whether the page has the comparison and all figures.
    pub(super) fn is_whole_page(&self) -> bool {
        self.planners.is_empty() && self.sets.is_empty() && self.figures.is_empty()
    }

    /// Minutes that the whole page takes on two cores; none of another number of cases.
    pub(super) fn expected_minutes(&self) -> Option<&'static str> {
        let is_usual = self.is_whole_page() && self.cases.is_none();
        is_usual.then_some(MINUTES[usize::from(self.quick)])
    }

    pub(super) fn cases(&self) -> usize {
        self.cases.unwrap_or(CASES[usize::from(self.quick)])
    }
}

fn named_twice(names: &[String]) -> Option<&String> {
    let mut seen = BTreeSet::new();
    names.iter().find(|name| !seen.insert(*name))
}
