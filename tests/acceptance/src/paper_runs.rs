//! What the groups of the paper's checks share: its unseen data sets, and evaluations of its planners.

use std::path::Path;

use crate::runs::{Evaluation, Model, Unseen};
use crate::scale::Scale;

/// Cases of every ablation; those with and without lower precision are the same.
pub(crate) fn ablation_cases(scale: Scale) -> usize {
    scale.pick(20, 300)
}

const fn of_the_paper(
    name: &'static str,
    setting: &'static str,
    seed: u64,
    weights: &'static str,
) -> Unseen {
    Unseen {
        name,
        method: "paper",
        setting,
        seed,
        starts: 5,
        ends: 10,
        targets_for_ten_cases: 4,
        weights,
    }
}

pub(crate) const MIXED: Unseen = of_the_paper("mixed", "reference", 9003, "mixed");
pub(crate) const FREE: Unseen = of_the_paper("obstacle-free", "obstacle-free", 9004, "free");
pub(crate) const GENERAL: Unseen = of_the_paper("general", "general", 9005, "general");
pub(crate) const HARD: Unseen = Unseen {
    name: "hard",
    method: "cases",
    setting: "hard",
    seed: 9002,
    starts: 3,
    ends: 1,
    targets_for_ten_cases: 9,
    weights: "general",
};

/// One of the paper's planners, or the null arm, with the paper's steps and solver.
pub(crate) fn evaluation<'a>(
    setting: &'a str,
    dataset: &'a Path,
    model: &Model,
    planner: &'a str,
    cases: usize,
) -> Evaluation<'a> {
    let evaluation = Evaluation::of(setting, dataset, planner, cases);
    if planner.starts_with("diffusion") {
        evaluation.model(model)
    } else {
        evaluation
    }
}
