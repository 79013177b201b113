//! A matrix packed for f32 products.

use super::job::PANEL;
use super::paged::Paged;
use crate::simd::dispatch::Level;

/// Outputs whose weights for an input lie together where products are computed with AVX2.
#[cfg(target_arch = "x86_64")]
pub(super) const HALF: usize = PANEL / 2;

/// The weights of one input for as many outputs as a panel has, on cache lines of its own.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub(super) struct Weights(pub(super) [f32; PANEL]);

/// A matrix packed as `[part of a panel][input][output in part]`, for the products of one level.
pub(super) struct F32Panels {
    pub(super) level: Level,
    pub(super) inputs: usize,
    pub(super) weights: Paged<Weights>,
}

impl F32Panels {
    /// Packs a row-major matrix (outputs × inputs).
    pub(super) fn new(level: Level, weight: &[f32], outputs: usize) -> Self {
        let inputs = weight.len() / outputs;
        let count = outputs.div_ceil(PANEL) * inputs;
        let mut panels = Self {
            level,
            inputs,
            weights: Paged::filled(Weights([0.0; PANEL]), count),
        };
        for output in 0..outputs {
            for input in 0..inputs {
                let place = panels.place(output, input);
                panels.weights[place / PANEL].0[place % PANEL] = weight[output * inputs + input];
            }
        }
        panels
    }

    /// The weight of an input for an output.
    pub(super) fn weight(&self, output: usize, input: usize) -> f32 {
        let place = self.place(output, input);
        self.weights[place / PANEL].0[place % PANEL]
    }

    /// Where the weight of an input for an output lies.
    fn place(&self, output: usize, input: usize) -> usize {
        let part = match self.level {
            #[cfg(target_arch = "x86_64")]
            Level::Avx2(_) => HALF,
            _ => PANEL,
        };
        (output / part * self.inputs + input) * part + output % part
    }
}
