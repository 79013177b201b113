//! f32 products.
#![allow(unsafe_code)] // calling what is compiled for features that were detected

use super::{Job, PANEL};
#[cfg(target_arch = "x86_64")]
use super::{narrow, wide};
use crate::paged::Paged;
use crate::simd::Level;

/// The weights of one input for as many outputs as a panel has, on cache lines of its own.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub(super) struct Weights(pub(super) [f32; PANEL]);

/// A matrix packed as `[part of a panel][input][output in part]`, for the products of one level.
pub(super) struct SinglePanels {
    level: Level,
    inputs: usize,
    weights: Paged<Weights>,
}

impl SinglePanels {
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
            Level::Avx2(_) => narrow::HALF,
            _ => PANEL,
        };
        (output / part * self.inputs + input) * part + output % part
    }

    pub(super) fn multiply(&self, job: Job<'_, f32>) {
        match self.level {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: the level proves that its features were detected.
            Level::Avx512(_) => unsafe { wide::multiply(&self.weights, self.inputs, job) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: the level proves that its features were detected.
            Level::Avx2(_) => unsafe { narrow::multiply(&self.weights, self.inputs, job) },
            Level::Plain => self.multiply_plainly(job),
        }
    }

    /// Computes without vector extensions.
    fn multiply_plainly(&self, mut job: Job<'_, f32>) {
        for block in job.blocks(1) {
            let weights = &self.weights[block.panel * self.inputs..][..self.inputs];
            let mut sums = [0.0; PANEL];
            for (Weights(weights), x) in weights.iter().zip(job.input(block, 0)) {
                let sums = sums.iter_mut().zip(weights);
                sums.for_each(|(sum, weight)| *sum += x * weight);
            }
            job.finish(block, 0, &sums);
        }
    }
}
