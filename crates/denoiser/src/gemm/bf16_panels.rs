//! A matrix packed for bf16 products.

use super::bf16::{Bf16, padded};
use super::job::PANEL;
use super::paged::Paged;

/// The weights of a pair of inputs for the outputs of a panel: `[output in panel][input of the pair]`.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub(super) struct PairWeights(pub(super) [[Bf16; 2]; PANEL]);

/// A matrix packed as `[panel][pair of inputs][output in panel][2]`, with zeros up to whole tiles.
pub(super) struct Bf16Panels {
    pairs: usize,
    weights: Paged<PairWeights>,
}

impl Bf16Panels {
    /// Packs a matrix (outputs × inputs), given the function from (output, input) to a weight.
    pub(super) fn new(inputs: usize, outputs: usize, weight: impl Fn(usize, usize) -> f32) -> Self {
        let pairs = padded(inputs) / 2;
        let mut weights = Paged::filled(
            PairWeights([[Bf16(0); 2]; PANEL]),
            outputs.div_ceil(PANEL) * pairs,
        );
        for output in 0..outputs {
            for input in 0..inputs {
                let pair = output / PANEL * pairs + input / 2;
                weights[pair].0[output % PANEL][input % 2] = Bf16::round(weight(output, input));
            }
        }
        Self { pairs, weights }
    }

    /// The weights for the outputs of a panel.
    pub(super) fn panel(&self, panel: usize) -> &[PairWeights] {
        &self.weights[panel * self.pairs..][..self.pairs]
    }
}
