//! What came of a comparison.

use super::figures::{ByBalls, Paired};
use crate::planner::ModelRecords;
use serde::Serialize;

/// The content of `compare.json`.
#[derive(Serialize)]
pub(super) struct Comparison {
    /// Planner that the others are paired with.
    pub(super) against: String,
    pub(super) candidates: usize,
    pub(super) seed: u64,
    pub(super) threads: usize,
    /// SHA-256 of the program.
    pub(super) program: String,
    /// Processor and number of cores of each machine on which a record was made.
    pub(super) machines: Vec<String>,
    /// Time that was measured in, in one run or several, s.
    pub(super) measuring_s: f64,
    pub(super) sets: Vec<SetResult>,
}

/// What came of one set of cases.
#[derive(Serialize)]
pub(super) struct SetResult {
    pub(super) set: String,
    pub(super) cases: usize,
    pub(super) planners: Vec<PlannerResult>,
}

/// What came of one planner on one set.
#[derive(Serialize)]
pub(super) struct PlannerResult {
    pub(super) planner: String,
    #[serde(flatten)]
    pub(super) models: ModelRecords,
    #[serde(flatten)]
    pub(super) figures: ByBalls,
    /// Beside the planner that it is paired with; none of that one itself.
    pub(super) paired: Option<Paired>,
}
