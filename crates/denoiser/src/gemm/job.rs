//! The rows of a product, and a product to be done.

use std::ops::Range;

/// Outputs whose weights are packed together: two AVX-512 registers.
pub(super) const PANEL: usize = 32;

/// Distances between rows in a buffer, in values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Strides {
    /// Values from a row of a candidate to its next row.
    pub row: usize,
    /// Values from the first row of a candidate to that of the next candidate.
    pub candidate: usize,
}

impl Strides {
    /// The first value of the first row of a block.
    #[inline(always)]
    pub(super) fn start(self, block: Block) -> usize {
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

    /// Where `N` rows start, from row `first` on when the rows of all candidates are counted in order.
    #[cfg(target_arch = "x86_64")]
    #[inline]
    pub(super) fn starts<const N: usize>(self, first: usize) -> [Start; N] {
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
    pub(super) fn end(&self, strides: Strides, width: usize) -> usize {
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
pub(super) struct Start {
    pub(super) from: usize,
    pub(super) to: usize,
}

/// Whether a product replaces the values of its output or is added to them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Store {
    /// y = W x + b.
    Replace,
    /// y += W x + b.
    Add,
}

/// A product to be done; its rows lie within `x` and `out`.
pub(super) struct Job<'a, T> {
    pub(super) x: &'a [T],
    pub(super) out: &'a mut [f32],
    pub(super) batch: Batch,
    /// Values of a row of x that are multiplied; where the matrix has fewer inputs, its weights are zero.
    pub(super) inputs: usize,
    pub(super) outputs: usize,
    pub(super) bias: &'a [Bias],
    pub(super) store: Store,
}

/// The bias of the outputs of a panel, with zeros for those that are not there.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub(super) struct Bias(pub(super) [f32; PANEL]);

/// Rows of one candidate that are computed together for one panel of outputs.
#[derive(Clone, Copy, PartialEq)]
pub(super) struct Block {
    pub(super) panel: usize,
    pub(super) candidate: usize,
    pub(super) first_row: usize,
    pub(super) rows: usize,
}

impl<T> Job<'_, T> {
    /// Every block of at most `most` rows, panel by panel, so that the weights of one are used for all rows in turn.
    #[inline(always)]
    pub(super) fn blocks(&self, most: usize) -> impl Iterator<Item = Block> + use<T> {
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
    pub(super) fn input(&self, block: Block, row: usize) -> &[T] {
        let from = self.batch.from;
        &self.x[from.start(block) + row * from.row..][..self.inputs]
    }

    /// Outputs of a panel.
    #[inline(always)]
    pub(super) fn columns(&self, panel: usize) -> Range<usize> {
        panel * PANEL..self.outputs.min((panel + 1) * PANEL)
    }

    /// Writes the products of a row and the bias.
    #[inline(always)]
    pub(super) fn finish(&mut self, block: Block, row: usize, sums: &[f32; PANEL]) {
        let mut values = *sums;
        let bias = &self.bias[block.panel].0;
        values.iter_mut().zip(bias).for_each(|(v, b)| *v += b);
        self.write(block, row, &values);
    }

    /// Writes the outputs of a row.
    #[inline(always)]
    pub(super) fn write(&mut self, block: Block, row: usize, values: &[f32; PANEL]) {
        let to = self.batch.to;
        let columns = self.columns(block.panel);
        let target = &mut self.out[to.start(block) + row * to.row..][columns];
        match self.store {
            Store::Replace => target.iter_mut().zip(values).for_each(|(t, v)| *t = *v),
            Store::Add => target.iter_mut().zip(values).for_each(|(t, v)| *t += v),
        }
    }
}
