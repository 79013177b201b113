//! Fully connected layers: y = W x + b for a batch of rows.
//!
//! Every output is one chain of multiply-adds over the inputs in order, whatever the number of rows, so a row's
//! result does not depend on the batch it is in. Weights are read once for all the rows that fit the registers.

use crate::simd::{Kernel, Level, dispatch, multiply_add};
use crate::weights_file::{WeightsError, WeightsFile};

/// Outputs computed together: two AVX-512 registers.
const PANEL: usize = 32;

/// A layer with its weights packed in panels of `PANEL` outputs, `[panel][input][output in panel]`.
pub(crate) struct Linear {
    inputs: usize,
    outputs: usize,
    panels: Vec<f32>,
    bias: Vec<f32>,
}

impl Linear {
    pub(crate) fn load(
        file: &WeightsFile,
        name: &str,
        inputs: usize,
        outputs: usize,
    ) -> Result<Self, WeightsError> {
        let weight = file.tensor(&format!("{name}.weight"), &[outputs, inputs])?;
        let bias = file.tensor(&format!("{name}.bias"), &[outputs])?;
        Ok(Self::pack(weight, bias, inputs))
    }

    /// Packs a row-major weight matrix (outputs × inputs) and its bias.
    fn pack(weight: &[f32], bias: &[f32], inputs: usize) -> Self {
        let outputs = bias.len();
        let padded = outputs.next_multiple_of(PANEL);
        let mut panels = vec![0.0; padded * inputs];
        for (output, row) in weight.chunks_exact(inputs).enumerate() {
            let (panel, column) = (output / PANEL, output % PANEL);
            for (input, value) in row.iter().enumerate() {
                panels[(panel * inputs + input) * PANEL + column] = *value;
            }
        }
        let mut bias = bias.to_vec();
        bias.resize(padded, 0.0);
        Self {
            inputs,
            outputs,
            panels,
            bias,
        }
    }

    /// Writes W x + b for each row of `x` (rows × inputs) into `out` (rows × outputs).
    pub(crate) fn apply(&self, x: &[f32], out: &mut [f32]) {
        dispatch(Product {
            layer: self,
            x,
            out,
            add: false,
        });
    }

    /// Adds W x + b for each row of `x` to `out`.
    pub(crate) fn accumulate(&self, x: &[f32], out: &mut [f32]) {
        dispatch(Product {
            layer: self,
            x,
            out,
            add: true,
        });
    }
}

struct Product<'a> {
    layer: &'a Linear,
    x: &'a [f32],
    out: &'a mut [f32],
    add: bool,
}

impl Kernel for Product<'_> {
    #[inline(always)]
    fn run<L: Level>(mut self) {
        let rows = self.x.len() / self.layer.inputs;
        assert_eq!(rows * self.layer.inputs, self.x.len(), "whole input rows");
        assert_eq!(
            rows * self.layer.outputs,
            self.out.len(),
            "a row out for each row in"
        );
        let blocks = rows.div_ceil(L::ROWS);
        for panel in 0..self.layer.bias.len() / PANEL {
            for block in 0..blocks {
                let (first, end) = (block * rows / blocks, (block + 1) * rows / blocks);
                self.rows::<L>(panel, first, end - first);
            }
        }
    }
}

impl Product<'_> {
    /// Some rows, at most `L::ROWS`, times one panel.
    #[inline(always)]
    fn rows<L: Level>(&mut self, panel: usize, first: usize, count: usize) {
        match count {
            1 => self.block::<1, L>(panel, first),
            2 => self.block::<2, L>(panel, first),
            3 => self.block::<3, L>(panel, first),
            4 => self.block::<4, L>(panel, first),
            5 if L::ROWS >= 5 => self.block::<5, L>(panel, first),
            6 if L::ROWS >= 6 => self.block::<6, L>(panel, first),
            7 if L::ROWS >= 7 => self.block::<7, L>(panel, first),
            8 if L::ROWS >= 8 => self.block::<8, L>(panel, first),
            9 if L::ROWS >= 9 => self.block::<9, L>(panel, first),
            10 if L::ROWS >= 10 => self.block::<10, L>(panel, first),
            11 if L::ROWS >= 11 => self.block::<11, L>(panel, first),
            12 if L::ROWS >= 12 => self.block::<12, L>(panel, first),
            _ => unreachable!("a block has 1 to {} rows, not {count}", L::ROWS),
        }
    }

    #[inline(always)]
    fn block<const N: usize, L: Level>(&mut self, panel: usize, first: usize) {
        let Linear {
            inputs,
            outputs,
            panels,
            bias,
        } = self.layer;
        let rows: [&[f32]; N] = std::array::from_fn(|r| &self.x[(first + r) * inputs..][..*inputs]);
        let weights = &panels[panel * inputs * PANEL..][..inputs * PANEL];
        let mut sums = [[0.0_f32; PANEL]; N];
        for (k, weights) in weights.as_chunks::<PANEL>().0.iter().enumerate() {
            for (sum, row) in sums.iter_mut().zip(&rows) {
                let value = row[k];
                for (s, w) in sum.iter_mut().zip(weights) {
                    *s = multiply_add::<L>(value, *w, *s);
                }
            }
        }
        let columns = panel * PANEL..outputs.min(&((panel + 1) * PANEL)).to_owned();
        for (r, sum) in sums.iter().enumerate() {
            let target = &mut self.out[(first + r) * outputs..][columns.clone()];
            for ((t, s), b) in target.iter_mut().zip(sum).zip(&bias[columns.clone()]) {
                *t = if self.add { *t + (s + b) } else { s + b };
            }
        }
    }
}
