//! Unseen cases that the default planner and those beside it are evaluated on.

use std::path::PathBuf;

use anyhow::ensure;
use datasets::ArchiveReader;
use serde_json::Value;
use tests::programs::repository;

use crate::report::Report;
use crate::runs::{Evaluation, Unseen};
use crate::scale::Scale;
use crate::second_look::Motions;

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
    /// In the names of the folders.
    label: String,
    dataset: PathBuf,
    count: usize,
}

impl Cases {
    /// Cases made on the spot.
    pub(crate) fn unseen(unseen: &Unseen, count: usize) -> anyhow::Result<Self> {
        Ok(Self {
            name: unseen.name,
            label: format!("fast-{}", unseen.name),
            dataset: unseen.make(count)?,
            count,
        })
    }

    /// The authors' own, all of them.
    pub(crate) fn sample() -> Self {
        Self {
            name: "reference sample",
            label: "fast-reference-sample".to_owned(),
            dataset: repository().join("tests/data/reference-mixed-sample"),
            count: 60,
        }
    }

    /// Only the first ones.
    pub(crate) fn first(self, count: usize) -> Self {
        Self { count, ..self }
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
        let mut archive = ArchiveReader::open(&evaluation.out().join("paths.npz"))?;
        let motions = Motions::read(&mut archive)?;
        let (found, wanted) = (motions.cases(), self.count);
        ensure!(found == wanted, "{}: {found} of {wanted} cases", self.name);
        Ok((result, motions))
    }
}

/// Cases of a setting in the checks of certified shares and of quality.
pub(crate) fn count(scale: Scale) -> usize {
    scale.pick(30, 1000)
}
