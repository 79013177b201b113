//! Buffers of the network's gradient.

use super::block::GradientWork;
use super::dimensions::STAGES;
use crate::layers::convolution::Rows;

/// Buffers of [`TemporalUnet::pull_back`](super::network::TemporalUnet::pull_back).
#[derive(Default)]
pub(super) struct GradientScratch {
    pub(super) cotangent: Rows,
    /// With respect to the output of each stage, then to its entry.
    pub(super) stages: [Rows; STAGES],
    pub(super) grown: Rows,
    pub(super) input: Rows,
    pub(super) work: GradientWork,
}
