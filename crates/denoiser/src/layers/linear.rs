//! Fully connected layers: y = W x + b for rows that lie one behind the other.

use crate::gemm::{Batch, Input, Packed, Precision, Store, padded};
use crate::layers::factors::Factors;
use crate::weights::error::WeightsError;
use crate::weights::file::WeightsFile;

/// A fully connected layer with its weights.
pub(crate) struct Linear {
    product: Packed,
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
        Ok(Self::pack(weight, bias))
    }

    /// Packs a row-major weight matrix (outputs × inputs) and its bias.
    pub(crate) fn pack(weight: &[f32], bias: &[f32]) -> Self {
        Self {
            product: Packed::new(weight, bias),
        }
    }

    /// Packs the weights for a precision, which the first product in that precision would do otherwise.
    pub(crate) fn prepare(&self, precision: Precision) {
        self.product.prepare(precision);
    }

    /// Writes W x + b in f32 for each row of `x` (rows × inputs) into `out` (rows × outputs).
    pub(crate) fn apply(&self, x: &[f32], out: &mut [f32]) {
        self.multiply(x, &mut Factors::default(), out, Store::Replace);
    }

    /// Writes or adds W x + b for each row of `x` (rows × inputs) in the precision of the factors.
    pub(crate) fn multiply(&self, x: &[f32], factors: &mut Factors, out: &mut [f32], store: Store) {
        let (inputs, outputs) = (self.product.inputs(), self.product.outputs());
        let rows = x.len() / inputs;
        assert_eq!(rows * inputs, x.len(), "whole input rows");
        assert_eq!(rows * outputs, out.len(), "a row out for each row in");
        let x = factors.of_rows(x, inputs);
        let stride = match x {
            Input::PaddedBf16(_) => padded(inputs),
            _ => inputs,
        };
        let batch = Batch::contiguous(rows, stride, outputs);
        self.product.multiply(x, out, batch, store);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_of_any_number_and_width_are_multiplied_in_both_precisions() {
        for (inputs, outputs) in [(1, 1), (28, 33), (32, 64), (72, 40)] {
            // small whole numbers: exact in bf16 too
            let value = |i: usize| (i * 7 % 11) as f32 - 5.0;
            let weight: Vec<f32> = (0..inputs * outputs).map(value).collect();
            let bias: Vec<f32> = (0..outputs).map(value).collect();
            let layer = Linear::pack(&weight, &bias);
            for rows in [0, 1, 5, 10, 16, 17, 33, 40] {
                let x: Vec<f32> = (0..rows * inputs).map(|i| value(i + 3)).collect();
                let dot = |row: &[f32], o: usize| {
                    let weights = &weight[o * inputs..][..inputs];
                    row.iter().zip(weights).map(|(x, w)| x * w).sum::<f32>() + bias[o]
                };
                let rows = x.chunks_exact(inputs);
                let expected: Vec<f32> = rows
                    .flat_map(|row| (0..outputs).map(move |o| dot(row, o)))
                    .collect();
                for precision in [Precision::F32, Precision::Bf16] {
                    if !precision.available() {
                        continue;
                    }
                    let mut factors = Factors::default();
                    factors.set_precision(precision);
                    let mut out = vec![f32::NAN; expected.len()];
                    layer.multiply(&x, &mut factors, &mut out, Store::Replace);
                    assert_eq!(out, expected, "{precision}");
                    layer.multiply(&x, &mut factors, &mut out, Store::Add);
                    let twice: Vec<f32> = expected.iter().map(|v| 2.0 * v).collect();
                    assert_eq!(out, twice, "{precision}");
                }
            }
        }
    }

    #[test]
    #[should_panic(expected = "whole input rows")]
    fn a_row_of_another_length_is_refused() {
        let layer = Linear::pack(&[1.0; 12], &[2.0; 4]);
        layer.apply(&[0.0; 5], &mut [0.0; 4]);
    }
}
