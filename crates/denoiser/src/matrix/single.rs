//! f32 products.
#![allow(unsafe_code)] // calling what is compiled for features that were detected

#[cfg(target_arch = "x86_64")]
use super::wide;
use super::{Block, Job};
use crate::paged::Paged;
use crate::simd::{Detected, Kernel, Level, PANEL, detected, run_at};

/// The weights of one input for the outputs of one panel, on cache lines of its own.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub(super) struct Weights(pub(super) [f32; PANEL]);

/// A matrix packed as `[panel][input][output in panel]`.
pub(super) struct SinglePanels {
    inputs: usize,
    weights: Paged<Weights>,
}

impl SinglePanels {
    /// Packs a row-major matrix (outputs × inputs).
    pub(super) fn new(weight: &[f32], outputs: usize) -> Self {
        let inputs = weight.len() / outputs;
        let count = outputs.div_ceil(PANEL) * inputs;
        let mut weights = Paged::filled(Weights([0.0; PANEL]), count);
        for output in 0..outputs {
            for input in 0..inputs {
                weights[output / PANEL * inputs + input].0[output % PANEL] =
                    weight[output * inputs + input];
            }
        }
        Self { inputs, weights }
    }

    /// The weight of an input for an output.
    pub(super) fn weight(&self, output: usize, input: usize) -> f32 {
        self.weights[output / PANEL * self.inputs + input].0[output % PANEL]
    }

    pub(super) fn multiply(&self, job: Job<'_, f32>) {
        self.multiply_at(detected(), job);
    }

    /// Computes at a level that was detected.
    pub(super) fn multiply_at(&self, level: Detected, job: Job<'_, f32>) {
        #[cfg(target_arch = "x86_64")]
        if level.has_avx512() {
            // SAFETY: its features were detected.
            unsafe { wide::multiply(&self.weights, self.inputs, job) };
            return;
        }
        run_at(level, Product { panels: self, job });
    }
}

struct Product<'a> {
    panels: &'a SinglePanels,
    job: Job<'a, f32>,
}

impl Kernel for Product<'_> {
    #[inline(always)]
    fn run<L: Level>(mut self) {
        for block in self.job.blocks(L::ROWS) {
            self.rows::<L>(block);
        }
    }
}

impl Product<'_> {
    /// Some rows, at most `L::ROWS`, times one panel.
    #[inline(always)]
    fn rows<L: Level>(&mut self, block: Block) {
        match block.rows {
            1 => self.block::<1, L>(block),
            2 => self.block::<2, L>(block),
            3 => self.block::<3, L>(block),
            4 => self.block::<4, L>(block),
            5 if L::ROWS >= 5 => self.block::<5, L>(block),
            6 if L::ROWS >= 6 => self.block::<6, L>(block),
            7 if L::ROWS >= 7 => self.block::<7, L>(block),
            8 if L::ROWS >= 8 => self.block::<8, L>(block),
            9 if L::ROWS >= 9 => self.block::<9, L>(block),
            10 if L::ROWS >= 10 => self.block::<10, L>(block),
            11 if L::ROWS >= 11 => self.block::<11, L>(block),
            12 if L::ROWS >= 12 => self.block::<12, L>(block),
            count => unreachable!("a block has 1 to {} rows, not {count}", L::ROWS),
        }
    }

    #[inline(always)]
    fn block<const N: usize, L: Level>(&mut self, block: Block) {
        let inputs = self.panels.inputs;
        let weights = &self.panels.weights[block.panel * inputs..][..inputs];
        let rows: [&[f32]; N] = std::array::from_fn(|r| self.job.input(block, r));
        let mut sums = [L::load(&[0.0; PANEL]); N];
        for (k, weights) in weights.iter().enumerate() {
            let weights = L::load(&weights.0);
            for (sum, row) in sums.iter_mut().zip(&rows) {
                *sum = L::add_scaled(*sum, row[k], weights);
            }
        }
        for (r, sum) in sums.into_iter().enumerate() {
            self.job.finish(block, r, &L::store(sum));
        }
    }
}
