//! A constant matrix and its bias, packed for products.

use super::bf16::{Bf16, padded};
use super::bf16_panels::Bf16Panels;
use super::bf16_unit::Bf16Unit;
use super::f32_panels::F32Panels;
use super::input::Input;
use super::job::{Batch, Bias, Job, PANEL, Store};
use super::precision::Precision;
use super::{bf16_product, f32_product};
use crate::simd::dispatch::detected;
use std::sync::OnceLock;

/// A matrix W (outputs × inputs) and a bias, packed for products.
pub struct Packed {
    inputs: usize,
    outputs: usize,
    bias: Vec<Bias>,
    f32_panels: F32Panels,
    bf16_panels: OnceLock<Bf16Panels>,
}

impl Packed {
    /// Packs a row-major matrix (outputs × inputs) and its bias (outputs).
    ///
    /// # Panics
    ///
    /// When there is no output or no input, or the matrix is not `bias.len()` rows of equal length.
    #[must_use]
    pub fn new(weight: &[f32], bias: &[f32]) -> Self {
        let outputs = bias.len();
        assert!(outputs > 0, "at least one output");
        let inputs = weight.len() / outputs;
        assert!(inputs > 0, "at least one input");
        assert_eq!(
            weight.len(),
            inputs * outputs,
            "a whole row for each output"
        );
        let bias = bias.chunks(PANEL).map(|chunk| {
            let mut panel = Bias([0.0; PANEL]);
            panel.0[..chunk.len()].copy_from_slice(chunk);
            panel
        });
        Self {
            inputs,
            outputs,
            bias: bias.collect(),
            f32_panels: F32Panels::new(detected(), weight, outputs),
            bf16_panels: OnceLock::new(),
        }
    }

    /// Values of a row of x.
    #[must_use]
    pub fn inputs(&self) -> usize {
        self.inputs
    }

    /// Values of a row of y.
    #[must_use]
    pub fn outputs(&self) -> usize {
        self.outputs
    }

    /// Packs for a precision now, not in the first product that needs it.
    pub fn prepare(&self, precision: Precision) {
        if precision == Precision::Bf16 {
            self.bf16_panels();
        }
    }

    /// Computes W x + b for every row of a batch.
    ///
    /// # Panics
    ///
    /// When a row lies outside of `x` or `out`, or the precision is not [available](Precision::available).
    pub fn multiply(&self, x: Input<'_>, out: &mut [f32], batch: Batch, store: Store) {
        match x {
            Input::F32(x) => {
                let job = self.job(x, self.inputs, out, batch, store);
                f32_product::multiply(&self.f32_panels, job);
            }
            Input::Bf16(x) => {
                let job = self.job(x, self.inputs, out, batch, store);
                bf16_product::multiply(self.bf16_panels(), Bf16Unit::expected(), job);
            }
            Input::PaddedBf16(x) => {
                let job = self.job(x, padded(self.inputs), out, batch, store);
                bf16_product::multiply(self.bf16_panels(), Bf16Unit::expected(), job);
            }
        }
    }

    /// Computes W x + b in bf16 on a certain unit, to compare them.
    ///
    /// # Panics
    ///
    /// When a row lies outside of `x` or `out`.
    pub fn multiply_on(
        &self,
        unit: Bf16Unit,
        x: &[Bf16],
        out: &mut [f32],
        batch: Batch,
        store: Store,
    ) {
        let job = self.job(x, self.inputs, out, batch, store);
        bf16_product::multiply(self.bf16_panels(), unit, job);
    }

    fn bf16_panels(&self) -> &Bf16Panels {
        self.bf16_panels.get_or_init(|| {
            Bf16Panels::new(self.inputs, self.outputs, |o, i| {
                self.f32_panels.weight(o, i)
            })
        })
    }

    fn job<'a, T>(
        &'a self,
        x: &'a [T],
        inputs: usize,
        out: &'a mut [f32],
        batch: Batch,
        store: Store,
    ) -> Job<'a, T> {
        assert!(
            batch.end(batch.from, inputs) <= x.len(),
            "rows of {inputs} inputs within {} values: {batch:?}",
            x.len()
        );
        assert!(
            batch.end(batch.to, self.outputs) <= out.len(),
            "rows of {} outputs within {} values: {batch:?}",
            self.outputs,
            out.len()
        );
        Job {
            x,
            out,
            batch,
            inputs,
            outputs: self.outputs,
            bias: &self.bias,
            store,
        }
    }
}

#[cfg(test)]
mod tests;
