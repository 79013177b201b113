//! Fully connected layers: y = W x + b for a batch of rows.
//!
//! Every output is one chain of multiply-adds over the inputs in order, whatever the number of rows, so a row's
//! result does not depend on the batch it is in.

use crate::simd::{Kernel, dispatch, multiply_add};
use crate::weights_file::{WeightsError, WeightsFile};

/// Outputs computed together: two AVX-512 registers.
const PANEL: usize = 32;
/// Rows computed together.
const ROWS: usize = 4;

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
        let count = outputs.div_ceil(PANEL);
        let mut panels = vec![0.0; count * inputs * PANEL];
        for output in 0..outputs {
            let (panel, column) = (output / PANEL, output % PANEL);
            for input in 0..inputs {
                panels[(panel * inputs + input) * PANEL + column] = weight[output * inputs + input];
            }
        }
        let mut padded = bias.to_vec();
        padded.resize(count * PANEL, 0.0);
        Ok(Self {
            inputs,
            outputs,
            panels,
            bias: padded,
        })
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
    fn run<const FUSED: bool>(self) {
        let Linear {
            inputs,
            outputs,
            panels,
            bias,
        } = self.layer;
        debug_assert_eq!(self.x.len() / inputs, self.out.len() / outputs);
        for (p, panel) in panels.chunks_exact(inputs * PANEL).enumerate() {
            let bias = &bias[p * PANEL..][..PANEL];
            let columns = p * PANEL..outputs.min(&((p + 1) * PANEL)).to_owned();
            let blocks = self
                .x
                .chunks(ROWS * inputs)
                .zip(self.out.chunks_mut(ROWS * outputs));
            for (x, out) in blocks {
                match x.len() / inputs {
                    4 => block::<4, FUSED>(
                        x,
                        panel,
                        bias,
                        out,
                        columns.clone(),
                        *inputs,
                        *outputs,
                        self.add,
                    ),
                    3 => block::<3, FUSED>(
                        x,
                        panel,
                        bias,
                        out,
                        columns.clone(),
                        *inputs,
                        *outputs,
                        self.add,
                    ),
                    2 => block::<2, FUSED>(
                        x,
                        panel,
                        bias,
                        out,
                        columns.clone(),
                        *inputs,
                        *outputs,
                        self.add,
                    ),
                    _ => block::<1, FUSED>(
                        x,
                        panel,
                        bias,
                        out,
                        columns.clone(),
                        *inputs,
                        *outputs,
                        self.add,
                    ),
                }
            }
        }
    }
}

/// `N` rows times one panel.
#[inline(always)]
#[allow(clippy::too_many_arguments)] // the innermost kernel: a struct here would only rename them
fn block<const N: usize, const FUSED: bool>(
    x: &[f32],
    panel: &[f32],
    bias: &[f32],
    out: &mut [f32],
    columns: std::ops::Range<usize>,
    inputs: usize,
    outputs: usize,
    add: bool,
) {
    let rows: [&[f32]; N] = std::array::from_fn(|r| &x[r * inputs..][..inputs]);
    let mut sums = [[0.0_f32; PANEL]; N];
    for (k, weights) in panel.chunks_exact(PANEL).enumerate() {
        for (sum, row) in sums.iter_mut().zip(&rows) {
            let value = row[k];
            for (s, w) in sum.iter_mut().zip(weights) {
                *s = multiply_add::<FUSED>(value, *w, *s);
            }
        }
    }
    for (r, sum) in sums.iter().enumerate() {
        let target = &mut out[r * outputs..][columns.clone()];
        for ((t, s), b) in target.iter_mut().zip(sum).zip(bias) {
            *t = if add { *t + s + b } else { s + b };
        }
    }
}
