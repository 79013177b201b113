//! Selecting one certified candidate by a rule.

use crate::path::metrics::PathMetrics;
use crate::plan::Candidate;
use codes::{Selection, Source};
use pcc_model::Configuration;

/// Whether a motion that is followed, with the cost `followed`, is to be left for one with the cost `other`.
pub(super) fn is_worth_a_change(followed: f64, other: f64) -> bool {
    followed > other + WORTH_A_CHANGE * other.abs()
}

/// The quantity that a rule minimizes, for a motion that ends at `end`.
fn cost(
    metrics: &PathMetrics,
    end: &Configuration,
    start: &Configuration,
    selection: Selection,
) -> f64 {
    match selection {
        Selection::ShortestTime | Selection::ByIndex => metrics.duration_s,
        Selection::ShortestTipPath => metrics.tip_length,
        Selection::LargestClearance => -metrics.clearance,
        Selection::Smoothest => metrics.tip_smoothness,
        Selection::NearestGoalConfiguration => (end - start).norm(),
    }
}

/// A motion that is followed is not left for one that is better by less than this share.
const WORTH_A_CHANGE: f64 = 0.1;

/// Index of the candidate that is best by a rule (by index: of least duration); nothing if there is none.
///
/// What remains of a motion that is followed stays selected unless another one is better by a tenth.
#[must_use]
pub fn select(
    candidates: &[Candidate],
    start: &Configuration,
    selection: Selection,
) -> Option<usize> {
    let cost_of = |index: &usize| {
        let candidate = &candidates[*index];
        cost(&candidate.metrics, &candidate.end(), start, selection)
    };
    let best = (0..candidates.len()).min_by(|a, b| cost_of(a).total_cmp(&cost_of(b)))?;
    let kept = candidates.iter().position(|c| c.source == Source::Kept);
    let stays = |kept: &usize| !is_worth_a_change(cost_of(kept), cost_of(&best));
    Some(kept.filter(stays).unwrap_or(best))
}
