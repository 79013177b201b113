//! Fully connected layers: y = W x + b for a batch of rows.
//!
//! Every output is one chain of multiply-adds over the inputs in order, whatever the number of rows, so a row's
//! result does not depend on the batch it is in. Weights are read once for all the rows that fit the registers.

use crate::lanes::Lanes;
use crate::simd::{Kernel, Level, PANEL, dispatch};
use crate::weights_file::{WeightsError, WeightsFile};

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
    pub(crate) fn pack(weight: &[f32], bias: &[f32], inputs: usize) -> Self {
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
    fn run<L: Lanes>(mut self) {
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
        let mut sums = [L::load(&[0.0; PANEL]); N];
        for (k, weights) in weights.as_chunks::<PANEL>().0.iter().enumerate() {
            let weights = L::load(weights);
            for (sum, row) in sums.iter_mut().zip(&rows) {
                *sum = L::add_scaled(*sum, row[k], weights);
            }
        }
        let columns = panel * PANEL..outputs.min(&((panel + 1) * PANEL)).to_owned();
        for (r, sum) in sums.into_iter().enumerate() {
            let target = &mut self.out[(first + r) * outputs..][columns.clone()];
            for ((t, s), b) in target
                .iter_mut()
                .zip(L::store(sum))
                .zip(&bias[columns.clone()])
            {
                *t = if self.add { *t + (s + b) } else { s + b };
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::{detected_levels, run_at};

    /// Numbers without a pattern that a wrong index could hide in.
    fn scattered(count: usize, seed: u32) -> Vec<f32> {
        let value = |i: u32| (i.wrapping_mul(2_654_435_761).wrapping_add(seed) >> 8) as f32;
        (0..count as u32)
            .map(|i| value(i) / 16_777_216.0 - 0.5)
            .collect()
    }

    fn product(weight: &[f32], bias: &[f32], x: &[f32]) -> Vec<f64> {
        let dot = |a: &[f32], b: &[f32]| {
            let terms = a.iter().zip(b);
            terms
                .map(|(a, b)| f64::from(*a) * f64::from(*b))
                .sum::<f64>()
        };
        let outputs = |row| {
            let rows = weight.chunks_exact(weight.len() / bias.len()).zip(bias);
            rows.map(move |(w, b)| dot(w, row) + f64::from(*b))
        };
        x.chunks_exact(weight.len() / bias.len())
            .flat_map(outputs)
            .collect()
    }

    #[test]
    fn every_level_agrees_with_the_definition_for_any_number_of_rows() {
        let (inputs, outputs) = (37, 72);
        let (weight, bias) = (scattered(inputs * outputs, 1), scattered(outputs, 2));
        let layer = Linear::pack(&weight, &bias, inputs);
        for rows in 0..=26 {
            let x = scattered(rows * inputs, 3);
            let expected = product(&weight, &bias, &x);
            for level in detected_levels() {
                for (add, before) in [(false, 0.0_f32), (true, 7.0)] {
                    let mut out = vec![7.0; rows * outputs];
                    let product = Product {
                        layer: &layer,
                        x: &x,
                        out: &mut out,
                        add,
                    };
                    run_at(level, product);
                    let sums = expected.iter().map(|e| e + f64::from(before));
                    for (found, sum) in out.iter().zip(sums) {
                        let error = (f64::from(*found) - sum).abs();
                        assert!(error < 4e-6, "{rows} rows: {found} for {sum}");
                    }
                }
            }
        }
    }

    #[test]
    #[should_panic(expected = "whole input rows")]
    fn a_row_of_another_length_is_refused() {
        let layer = Linear::pack(&scattered(12, 1), &scattered(4, 2), 3);
        layer.apply(&[0.0; 5], &mut [0.0; 4]);
    }
}
