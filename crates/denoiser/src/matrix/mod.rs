//! Products of a constant matrix with many rows: y = W x + b in one of two precisions.
//!
//! The rows may overlap and have any stride, so that a convolution over time is a product on windows of its
//! time-major activations. The rows of several candidates go through together: the weights, which are by far the
//! larger part, are then read once for all of them. Every output is computed from its own row alone in a fixed order,
//! so a row's result does not depend, bit for bit, on the rows beside it or on their number.

mod brain;
#[cfg(target_arch = "x86_64")]
mod narrow;
#[cfg(test)]
pub(crate) mod presence;
mod single;
#[cfg(test)]
mod tests;
#[cfg(target_arch = "x86_64")]
mod tiles;
#[cfg(target_arch = "x86_64")]
mod vectors;
#[cfg(target_arch = "x86_64")]
mod wide;

use crate::simd::detected;
use brain::BrainPanels;
pub use brain::{Bf16Tiles, Bf16Vectors, Brain, BrainBuffer, Unit, padded};
use single::SinglePanels;
use std::fmt;
use std::ops::Range;
use std::str::FromStr;
use std::sync::OnceLock;
use thiserror::Error;

/// Outputs whose weights are packed together: two AVX-512 registers.
const PANEL: usize = 32;

/// The number format of the factors of a product; sums are always f32.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precision {
    /// f32: 24 significant bits.
    Single,
    /// bf16, "brain floating point": the range of f32 with 8 significant bits.
    Brain,
}

/// There is no precision of this name.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("precision {0:?} is unknown: f32 and bf16 are allowed")]
pub struct UnknownPrecision(String);

impl FromStr for Precision {
    type Err = UnknownPrecision;

    fn from_str(name: &str) -> Result<Self, UnknownPrecision> {
        match name {
            "f32" => Ok(Self::Single),
            "bf16" => Ok(Self::Brain),
            _ => Err(UnknownPrecision(name.to_owned())),
        }
    }
}

impl fmt::Display for Precision {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Single => "f32",
            Self::Brain => "bf16",
        })
    }
}

impl Precision {
    /// Whether this processor computes in this precision: [`Precision::Brain`] needs AVX-512 BF16.
    #[must_use]
    pub fn available(self) -> bool {
        match self {
            Self::Single => true,
            Self::Brain => Unit::best().is_some(),
        }
    }

    /// The precision with the fastest products here (decision 0009).
    pub(crate) fn fastest() -> Self {
        match Unit::best() {
            Some(unit) if unit.is_faster_than_single() => Self::Brain,
            Some(_) | None => Self::Single,
        }
    }
}

/// Distances between rows in a buffer, in values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Strides {
    /// From a row of a candidate to its next row.
    pub row: usize,
    /// From the first row of a candidate to that of the next candidate.
    pub candidate: usize,
}

impl Strides {
    /// The first value of the first row of a block.
    #[inline(always)]
    fn start(self, block: Block) -> usize {
        block.candidate * self.candidate + block.first_row * self.row
    }
}

/// The rows of a product: row `r` of candidate `c` starts at value `c · stride.candidate + r · stride.row` of a buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Batch {
    /// How many candidates.
    pub candidates: usize,
    /// Rows of each candidate.
    pub rows: usize,
    /// Where the rows of x lie; they may overlap.
    pub from: Strides,
    /// Where the rows of y lie; they must not overlap.
    pub to: Strides,
}

impl Batch {
    /// Rows that lie one behind the other in both buffers.
    #[must_use]
    pub fn contiguous(rows: usize, inputs: usize, outputs: usize) -> Self {
        Self {
            candidates: 1,
            rows,
            from: Strides {
                row: inputs,
                candidate: rows * inputs,
            },
            to: Strides {
                row: outputs,
                candidate: rows * outputs,
            },
        }
    }

    /// Where rows start; those of a candidate follow those of the candidate before.
    #[cfg(target_arch = "x86_64")]
    #[inline]
    fn starts<const N: usize>(self, first: usize) -> [Start; N] {
        let Self { rows, from, to, .. } = self;
        let (mut candidate, mut row) = (first / rows, first % rows);
        let mut starts = [Start::default(); N];
        for start in &mut starts {
            start.from = candidate * from.candidate + row * from.row;
            start.to = candidate * to.candidate + row * to.row;
            row += 1;
            if row == rows {
                (candidate, row) = (candidate + 1, 0);
            }
        }
        starts
    }

    /// One past the last value that rows of this width reach.
    fn end(&self, strides: Strides, width: usize) -> usize {
        if self.candidates == 0 || self.rows == 0 {
            return 0;
        }
        let candidate = (self.candidates - 1).saturating_mul(strides.candidate);
        let row = (self.rows - 1).saturating_mul(strides.row);
        candidate.saturating_add(row).saturating_add(width)
    }
}

/// Where a row starts in both buffers.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy, Default)]
struct Start {
    from: usize,
    to: usize,
}

/// The factors x of a product, which decide its precision.
#[derive(Clone, Copy)]
pub enum Input<'a> {
    /// For [`Precision::Single`].
    Single(&'a [f32]),
    /// For [`Precision::Brain`].
    Brain(&'a [Brain]),
    /// The same, with zeros behind each row up to [`padded`], as [`BrainBuffer::fill_rows`] makes them: needs no copies.
    PaddedBrain(&'a [Brain]),
}

impl Input<'_> {
    /// Without its first values.
    pub(crate) fn skip(self, count: usize) -> Self {
        match self {
            Self::Single(values) => Self::Single(&values[count..]),
            Self::Brain(values) => Self::Brain(&values[count..]),
            Self::PaddedBrain(values) => Self::PaddedBrain(&values[count..]),
        }
    }
}

/// What becomes of the values that stood in the output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Store {
    /// y = W x + b.
    Replace,
    /// y += W x + b.
    Add,
}

/// A product to be done; its rows lie within `x` and `out`.
struct Job<'a, T> {
    x: &'a [T],
    out: &'a mut [f32],
    batch: Batch,
    /// Values of a row of x that are multiplied; where the matrix has fewer inputs, its weights are zero.
    inputs: usize,
    outputs: usize,
    bias: &'a [Bias],
    store: Store,
}

/// The bias of the outputs of a panel, with zeros for those that are not there.
#[derive(Clone, Copy)]
#[repr(align(64))]
struct Bias([f32; PANEL]);

/// Rows of one candidate that are computed together for one panel of outputs.
#[derive(Clone, Copy, PartialEq)]
struct Block {
    panel: usize,
    candidate: usize,
    first_row: usize,
    rows: usize,
}

impl<T> Job<'_, T> {
    /// Every block of at most `most` rows, panel by panel, so that the weights of one are used for all rows in turn.
    #[inline(always)]
    fn blocks(&self, most: usize) -> impl Iterator<Item = Block> + use<T> {
        let Batch {
            candidates, rows, ..
        } = self.batch;
        let parts = rows.div_ceil(most);
        let panels = self.bias.len();
        (0..panels * candidates * parts).map(move |i| {
            let (panel, i) = (i / (candidates * parts), i % (candidates * parts));
            let (candidate, part) = (i / parts, i % parts);
            let first_row = part * rows / parts;
            Block {
                panel,
                candidate,
                first_row,
                rows: (part + 1) * rows / parts - first_row,
            }
        })
    }

    /// A row of x.
    #[inline(always)]
    fn input(&self, block: Block, row: usize) -> &[T] {
        let from = self.batch.from;
        &self.x[from.start(block) + row * from.row..][..self.inputs]
    }

    /// Outputs of a panel.
    #[inline(always)]
    fn columns(&self, panel: usize) -> Range<usize> {
        panel * PANEL..self.outputs.min((panel + 1) * PANEL)
    }

    /// Writes the products of a row and the bias.
    #[inline(always)]
    fn finish(&mut self, block: Block, row: usize, sums: &[f32; PANEL]) {
        let mut values = *sums;
        let bias = &self.bias[block.panel].0;
        values.iter_mut().zip(bias).for_each(|(v, b)| *v += b);
        self.write(block, row, &values);
    }

    /// Writes the outputs of a row.
    #[inline(always)]
    fn write(&mut self, block: Block, row: usize, values: &[f32; PANEL]) {
        let to = self.batch.to;
        let columns = self.columns(block.panel);
        let target = &mut self.out[to.start(block) + row * to.row..][columns];
        match self.store {
            Store::Replace => target.iter_mut().zip(values).for_each(|(t, v)| *t = *v),
            Store::Add => target.iter_mut().zip(values).for_each(|(t, v)| *t += v),
        }
    }
}

/// A matrix W (outputs × inputs) and a bias, packed for products.
pub struct Packed {
    inputs: usize,
    outputs: usize,
    bias: Vec<Bias>,
    single: SinglePanels,
    brain: OnceLock<BrainPanels>,
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
            single: SinglePanels::new(detected(), weight, outputs),
            brain: OnceLock::new(),
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
        if precision == Precision::Brain {
            self.brain_panels();
        }
    }

    /// Computes W x + b for every row of a batch.
    ///
    /// # Panics
    ///
    /// When a row lies outside of `x` or `out`, or the precision is not [available](Precision::available).
    pub fn multiply(&self, x: Input<'_>, out: &mut [f32], batch: Batch, store: Store) {
        match x {
            Input::Single(x) => {
                let job = self.job(x, self.inputs, out, batch, store);
                self.single.multiply(job);
            }
            Input::Brain(x) => {
                let job = self.job(x, self.inputs, out, batch, store);
                self.brain_panels().multiply(Unit::expected(), job);
            }
            Input::PaddedBrain(x) => {
                let job = self.job(x, padded(self.inputs), out, batch, store);
                self.brain_panels().multiply(Unit::expected(), job);
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
        unit: Unit,
        x: &[Brain],
        out: &mut [f32],
        batch: Batch,
        store: Store,
    ) {
        let job = self.job(x, self.inputs, out, batch, store);
        self.brain_panels().multiply(unit, job);
    }

    fn brain_panels(&self) -> &BrainPanels {
        self.brain.get_or_init(|| {
            BrainPanels::new(self.inputs, self.outputs, |o, i| self.single.weight(o, i))
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
