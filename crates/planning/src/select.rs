//! Choosing one certified candidate.

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

/// Index of the selected candidate; nothing if there is none, or none with the index asked for.
#[must_use]
pub fn select(
    candidates: &[Candidate],
    start: &Configuration,
    selection: Selection,
) -> Option<usize> {
    let cost = |c: &Candidate| match selection {
        Selection::ShortestTime => c.metrics.duration_s,
        Selection::ShortestTipPath => c.metrics.tip_length,
        Selection::LargestClearance => -c.metrics.clearance,
        Selection::Smoothest => c.metrics.tip_smoothness,
        Selection::NearestTerminalShape | Selection::Index(_) => (c.end() - start).norm(),
    };
    match selection {
        Selection::Index(index) => (index < candidates.len()).then_some(index),
        _ => (0..candidates.len())
            .min_by(|a, b| cost(&candidates[*a]).total_cmp(&cost(&candidates[*b]))),
    }
}
