//! Every kernel that this machine has, against the definition in f64.

use super::*;
use crate::gemm::bf16::Bf16Buffer;
use crate::gemm::job::Strides;
use crate::gemm::presence::has_bf16;
use crate::simd::dispatch::detected_levels;

/// Numbers in [−0.5, 0.5) that look random: a wrong index does not hide in them.
fn scattered(count: usize, seed: u32) -> Vec<f32> {
    let mixed = |i: u32| {
        let i = (i ^ seed << 24).wrapping_mul(0x85eb_ca6b);
        let i = (i ^ i >> 13).wrapping_mul(0xc2b2_ae35);
        (i ^ i >> 16) >> 8
    };
    (0..count as u32)
        .map(|i| mixed(i) as f32 / 16_777_216.0 - 0.5)
        .collect()
}

/// A product with rows that overlap, gaps between the rows of y, and unequal candidates.
struct Case {
    packed: Packed,
    weight: Vec<f32>,
    bias: Vec<f32>,
    x: Vec<f32>,
    batch: Batch,
}

/// What stands in y, and in its gaps, before a product.
const BEFORE: f32 = 7.0;

impl Case {
    fn new(candidates: usize, rows: usize, inputs: usize, outputs: usize) -> Self {
        let (weight, bias) = (scattered(inputs * outputs, 1), scattered(outputs, 2));
        let from = Strides {
            row: inputs.div_ceil(3),
            candidate: rows * inputs.div_ceil(3) + inputs,
        };
        let to = Strides {
            row: outputs + 3,
            candidate: rows * (outputs + 3) + 5,
        };
        let batch = Batch {
            candidates,
            rows,
            from,
            to,
        };
        Self {
            packed: Packed::new(&weight, &bias),
            x: scattered(batch.end(from, inputs), 3),
            weight,
            bias,
            batch,
        }
    }

    /// y in f64, of factors passed through `factor`, and for each value the sum of the sizes of its terms.
    fn expected(&self, store: Store, factor: impl Fn(f32) -> f64) -> Vec<(f64, f64)> {
        let Batch { from, to, .. } = self.batch;
        let inputs = self.packed.inputs();
        let mut out = vec![(f64::from(BEFORE), 0.0); self.batch.end(to, self.packed.outputs())];
        for (candidate, row) in self.rows() {
            let x = &self.x[candidate * from.candidate + row * from.row..][..inputs];
            let y = &mut out[candidate * to.candidate + row * to.row..];
            for ((y, w), b) in y.iter_mut().zip(self.weight.chunks(inputs)).zip(&self.bias) {
                let terms = || x.iter().zip(w).map(|(x, w)| factor(*x) * factor(*w));
                let before = if store == Store::Add { y.0 } else { 0.0 };
                *y = (
                    before + terms().sum::<f64>() + f64::from(*b),
                    before.abs() + terms().map(f64::abs).sum::<f64>() + f64::from(b.abs()),
                );
            }
        }
        out
    }

    fn rows(&self) -> impl Iterator<Item = (usize, usize)> + use<> {
        let rows = self.batch.rows;
        (0..self.batch.candidates * rows).map(move |i| (i / rows, i % rows))
    }

    /// The results of every level and unit, each with whether its factors are bf16.
    fn found(&self, store: Store) -> Vec<(&'static str, Vec<f32>)> {
        let before = vec![BEFORE; self.batch.end(self.batch.to, self.packed.outputs())];
        let in_f32 = detected_levels().into_iter().map(|level| {
            let mut out = before.clone();
            let packed = &self.packed;
            let job = packed.job(&self.x, packed.inputs, &mut out, self.batch, store);
            let panels = F32Panels::new(level, &self.weight, packed.outputs);
            f32_product::multiply(&panels, job);
            ("f32", out)
        });
        let in_bf16 = Bf16Unit::detected().iter().map(|unit| {
            let mut out = before.clone();
            let mut x = Bf16Buffer::default();
            x.fill(&self.x);
            let x = x.values();
            self.packed
                .multiply_on(*unit, x, &mut out, self.batch, store);
            ("bf16", out)
        });
        in_f32.chain(in_bf16).collect()
    }
}

/// Sizes around those of tiles, panels and blocks, and with and without whole pairs of inputs.
fn cases() -> impl Iterator<Item = Case> {
    let sizes = [
        (1, 1),
        (21, 64),
        (32, 32),
        (37, 72),
        (64, 6),
        (95, 33),
        (96, 96),
        (192, 64),
    ];
    let counts = (0..=40).map(|rows| (1, rows)).chain([
        (2, 16),
        (3, 16),
        (5, 16),
        (3, 17),
        (2, 33),
        (0, 16),
    ]);
    counts.flat_map(move |(candidates, rows)| {
        sizes
            .into_iter()
            .enumerate()
            .filter(move |(i, _)| (rows + i) % 3 == 0 || candidates != 1)
            .map(move |(_, (inputs, outputs))| Case::new(candidates, rows, inputs, outputs))
    })
}

#[test]
fn every_kernel_agrees_with_the_definition_for_its_own_factors() {
    for case in cases() {
        for store in [Store::Replace, Store::Add] {
            let in_f32 = case.expected(store, f64::from);
            let in_bf16 = case.expected(store, |v| f64::from(Bf16::round(v).widen()));
            for (kernel, found) in case.found(store) {
                let expected = if kernel == "f32" { &in_f32 } else { &in_bf16 };
                assert_eq!(found.len(), expected.len());
                for (found, (sum, size)) in found.iter().zip(expected) {
                    let error = (f64::from(*found) - sum).abs();
                    assert!(
                        error <= 1e-6 * size,
                        "{kernel}, {store:?}, {:?}, {} to {}: {found} for {sum}",
                        case.batch,
                        case.packed.inputs,
                        case.packed.outputs
                    );
                }
            }
        }
    }
}

#[test]
fn rounding_the_factors_to_bf16_loses_less_than_half_a_percent() {
    let case = Case::new(1, 64, 768, 256);
    let exact = case.expected(Store::Replace, f64::from);
    let norm = |values: &[f64]| values.iter().map(|v| v * v).sum::<f64>().sqrt();
    let size = norm(&exact.iter().map(|(sum, _)| *sum).collect::<Vec<_>>());
    for (kernel, found) in case.found(Store::Replace) {
        let errors = found.iter().zip(&exact);
        let errors: Vec<_> = errors.map(|(f, (sum, _))| f64::from(*f) - sum).collect();
        let relative = norm(&errors) / size;
        println!("{kernel}: relative error {relative:.1e}");
        let bound = if kernel == "f32" { 2e-6 } else { 5e-3 };
        assert!(relative < bound, "{kernel}: {relative}");
    }
}

#[test]
fn a_row_does_not_depend_on_its_neighbours_nor_on_their_number() {
    for (inputs, outputs) in [(21, 64), (96, 96), (192, 40)] {
        let all = Case::new(5, 32, inputs, outputs);
        let (from, to) = (all.batch.from, all.batch.to);
        for (candidate, row) in all.rows() {
            let mut alone = Case::new(1, 1, inputs, outputs);
            let first = candidate * from.candidate + row * from.row;
            alone.x = all.x[first..][..inputs].to_vec();
            if (candidate + row) % 7 == 0 {
                let first = candidate * to.candidate + row * to.row;
                for ((kernel, all), (_, alone)) in all
                    .found(Store::Replace)
                    .iter()
                    .zip(alone.found(Store::Replace))
                {
                    assert_eq!(all[first..][..outputs], alone[..outputs], "{kernel}");
                }
            }
        }
    }
}

#[test]
fn a_neighbour_that_is_not_finite_stays_alone_with_it() {
    let mut case = Case::new(1, 33, 21, 40);
    case.batch.from.row = 21;
    case.x = scattered(33 * 21, 3);
    case.x[17 * 21..][..21].fill(f32::NAN);
    for (kernel, found) in case.found(Store::Replace) {
        for (row, values) in found.chunks(case.batch.to.row).enumerate() {
            let not_finite = values[..40].iter().filter(|v| v.is_nan()).count();
            assert_eq!(
                not_finite,
                if row == 17 { 40 } else { 0 },
                "{kernel}, row {row}"
            );
        }
    }
}

#[test]
fn zeros_behind_the_rows_change_nothing() {
    for (rows, inputs, outputs) in [(1, 28, 128), (10, 72, 40), (37, 33, 33), (16, 64, 96)] {
        let (weight, bias) = (scattered(inputs * outputs, 1), scattered(outputs, 2));
        let packed = Packed::new(&weight, &bias);
        let x = scattered(rows * inputs, 3);
        for unit in Bf16Unit::detected() {
            let [mut tight, mut spaced] = [Bf16Buffer::default(), Bf16Buffer::default()];
            tight.fill(&x);
            spaced.fill_rows(&x, inputs);
            assert_eq!(spaced.values().len(), rows * padded(inputs));
            let mut expected = vec![BEFORE; rows * outputs];
            let mut found = expected.clone();
            let batch = |stride| Batch::contiguous(rows, stride, outputs);
            let (few, many) = (batch(inputs), batch(padded(inputs)));
            for store in [Store::Replace, Store::Add] {
                packed.multiply_on(*unit, tight.values(), &mut expected, few, store);
                let job = packed.job(spaced.values(), padded(inputs), &mut found, many, store);
                bf16_product::multiply(packed.bf16_panels(), *unit, job);
                assert_eq!(found, expected, "{unit:?}, {store:?}, {rows} rows");
            }
        }
    }
}

#[test]
fn the_processor_rounds_to_bf16_as_the_definition_does() {
    if !has_bf16() {
        return;
    }
    let special = [
        0.0,
        -0.0,
        f32::INFINITY,
        f32::NEG_INFINITY,
        f32::MAX,
        1e-40,
        -1e-40,
        1.0,
    ];
    let halfway = [0x3f80_8000, 0x3f81_8000, 0x3f80_8001, 0x3f80_7fff].map(f32::from_bits);
    let values = [&special[..], &halfway, &scattered(1000, 4)].concat();
    let mut buffer = Bf16Buffer::default();
    buffer.fill(&values);
    let expected: Vec<_> = values.iter().map(|v| Bf16::round(*v)).collect();
    assert_eq!(buffer.values(), expected);
    let halfway: Vec<_> = halfway.map(|v| Bf16::round(v).0).into();
    assert_eq!(halfway, [0x3f80, 0x3f82, 0x3f81, 0x3f80]);
    assert!(Bf16::round(f32::NAN).widen().is_nan());
}

#[test]
#[should_panic(expected = "rows of 3 inputs within 5 values")]
fn a_row_beyond_the_input_is_refused() {
    let packed = Packed::new(&scattered(12, 1), &scattered(4, 2));
    let batch = Batch::contiguous(2, 3, 4);
    packed.multiply(Input::F32(&[0.0; 5]), &mut [0.0; 8], batch, Store::Replace);
}

#[test]
#[should_panic(expected = "rows of 4 outputs within 7 values")]
fn a_row_beyond_the_output_is_refused() {
    let packed = Packed::new(&scattered(12, 1), &scattered(4, 2));
    let batch = Batch::contiguous(2, 3, 4);
    packed.multiply(Input::F32(&[0.0; 6]), &mut [0.0; 7], batch, Store::Replace);
}
