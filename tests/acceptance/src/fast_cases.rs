//! Unseen cases that the default planner and those beside it are evaluated on.

use std::path::PathBuf;

use anyhow::ensure;
use serde_json::Value;
use tests::programs::repository;

use crate::fast_crowded;
use crate::motions::Motions;
use crate::report::Report;
use crate::runs::{Evaluation, Unseen};
use crate::scale::Scale;

/// What the daemon serves, and what it is compared with.
pub(crate) const PLANNERS: [&str; 6] = [
    "default",
    "fast",
    "straight",
    "straight-drawn",
    "rrt-connect",
    "rrt-smooth",
];

const fn drawn(name: &'static str, seed: u64, targets_for_ten_cases: usize) -> Unseen {
    Unseen {
        name,
        method: "cases",
        setting: name,
        seed,
        starts: 3,
        ends: 1,
        targets_for_ten_cases,
        weights: "fast",
    }
}

pub(crate) const REFERENCE: Unseen = drawn("reference", 9011, 4);
pub(crate) const GENERAL: Unseen = drawn("general", 9012, 4);
pub(crate) const HARD: Unseen = drawn("hard", 9013, 10);

/// Cases in a folder.
pub(crate) struct Cases {
    pub(crate) name: &'static str,
    /// The part of the names of folders and files that tells them from others.
    pub(crate) label: String,
    dataset: PathBuf,
    count: usize,
}

impl Cases {
    /// Cases made on the spot.
    pub(crate) fn unseen(unseen: &Unseen, count: usize) -> anyhow::Result<Self> {
        Ok(Self {
            name: unseen.title(),
            label: format!("fast-{}", unseen.name),
            dataset: unseen.make(count)?,
            count,
        })
    }

    /// The authors' own cases, all of them.
    pub(crate) fn sample() -> Self {
        Self {
            name: "reference sample",
            label: "fast-reference-sample".to_owned(),
            dataset: repository().join("tests/data/reference-mixed-sample"),
            count: 60,
        }
    }

    /// Scenes of 8 to 16 balls as they are drawn, whoever solves them.
    pub(crate) fn crowded(count: usize) -> anyhow::Result<Self> {
        Ok(Self {
            name: "8 to 16 balls, whoever solves them",
            label: "fast-crowded".to_owned(),
            dataset: fast_crowded::make(count)?,
            count,
        })
    }

    /// Only the first ones.
    pub(crate) fn first(self, count: usize) -> Self {
        Self { count, ..self }
    }

    /// The same cases, with other names of the folders.
    pub(crate) fn labelled(&self, label: &str) -> Self {
        Self {
            name: self.name,
            label: format!("{}-{label}", self.label),
            dataset: self.dataset.clone(),
            count: self.count,
        }
    }

    /// A run of a planner over them.
    pub(crate) fn evaluation(&self, planner: &'static str) -> Evaluation<'_> {
        Evaluation::of(&self.label, &self.dataset, planner, self.count)
    }

    /// What a run came to: `result.json` and the motions.
    pub(crate) fn run(
        &self,
        report: &Report,
        scale: Scale,
        evaluation: &Evaluation,
    ) -> anyhow::Result<(Value, Motions)> {
        let result = evaluation.run(report, scale)?;
        Ok((result, self.motions(evaluation)?))
    }

    /// The motions of a run that has come to its end.
    pub(crate) fn motions(&self, evaluation: &Evaluation) -> anyhow::Result<Motions> {
        let motions = Motions::read(&evaluation.out(), &self.dataset)?;
        let (found, wanted) = (motions.cases(), self.count);
        ensure!(found == wanted, "{}: {found} of {wanted} cases", self.name);
        Ok(motions)
    }
}

/// Cases of a setting in the checks of certified shares and of quality.
pub(crate) fn count(scale: Scale) -> usize {
    scale.pick(30, 1000)
}
