//! Choosing one certified candidate.

use crate::metrics::PathMetrics;
use crate::plan::Candidate;
use pcc_model::Configuration;

/// What the best candidate is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Selection {
    /// Shortest duration.
    ShortestTime,
    /// Shortest way of the tip.
    ShortestTipPath,
    /// Largest clearance over the motion.
    LargestClearance,
    /// Smallest ∫‖p‴‖² of the tip's way.
    Smoothest,
    /// End shape nearest to the start shape.
    NearestTerminalShape,
    /// The candidate with this index.
    Index(usize),
}

/// What a rule wants to be small of a motion that ends at `end`.
pub(crate) fn cost(
    metrics: &PathMetrics,
    end: &Configuration,
    start: &Configuration,
    selection: Selection,
) -> f64 {
    match selection {
        Selection::ShortestTime => metrics.duration_s,
        Selection::ShortestTipPath => metrics.tip_length,
        Selection::LargestClearance => -metrics.clearance,
        Selection::Smoothest => metrics.tip_smoothness,
        Selection::NearestTerminalShape | Selection::Index(_) => (end - start).norm(),
    }
}

/// Index of the selected candidate; nothing if there is none, or none with the index asked for.
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
    match selection {
        Selection::Index(index) => (index < candidates.len()).then_some(index),
        _ => (0..candidates.len()).min_by(|a, b| cost_of(a).total_cmp(&cost_of(b))),
    }
}
