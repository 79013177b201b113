//! Numbers in bf16, and how numbers in f32 are rounded to it.
#![allow(unsafe_code)] // vector instructions, and calling what is compiled for features that were detected

use super::bf16_unit::Bf16Unit;
use super::paged::Paged;
#[cfg(target_arch = "x86_64")]
use std::arch::x86_64::*;

/// Pairs of inputs that one tile of weights holds.
pub(super) const STEP_PAIRS: usize = 16;
/// Values in a cache line, which is also how many inputs are multiplied at a time.
pub(super) const LINE: usize = 2 * STEP_PAIRS;

/// A number in bf16: the upper half of the f32 of the same value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(transparent)]
pub struct Bf16(pub(super) u16);

impl Bf16 {
    /// The nearest bf16, to even when two are equally near; subnormal numbers become zero, as the processor has it.
    #[must_use]
    pub fn round(value: f32) -> Self {
        let bits = value.to_bits();
        let upper = (bits >> 16) as u16;
        if value.is_nan() {
            return Self(upper | 0x40);
        }
        if value.is_subnormal() {
            return Self(upper & 0x8000);
        }
        let to_even = 0x7fff + u32::from(upper & 1);
        Self(((bits + to_even) >> 16) as u16)
    }

    /// The f32 of equal value.
    #[must_use]
    pub fn widen(self) -> f32 {
        f32::from_bits(u32::from(self.0) << 16)
    }
}

#[derive(Clone, Copy)]
#[repr(C, align(64))]
struct Line([Bf16; LINE]);

/// Numbers in bf16 that start on a cache line, which products read fastest when a stride is whole lines too.
#[derive(Default)]
pub struct Bf16Buffer {
    lines: Paged<Line>,
    len: usize,
}

impl Bf16Buffer {
    /// Becomes `values`, rounded to bf16; allocates only when it grows beyond what it held before.
    ///
    /// # Panics
    ///
    /// When [`Precision::Bf16`](super::Precision::Bf16) is not available.
    pub fn fill(&mut self, values: &[f32]) {
        self.round(values, values.len());
        self.len = values.len();
    }

    /// Becomes rows of `width` values, rounded to bf16, each with zeros behind it up to [`padded`]; allocates as
    /// [`fill`](Self::fill) does.
    ///
    /// # Panics
    ///
    /// As [`fill`](Self::fill), and when the values are not whole rows.
    pub fn fill_rows(&mut self, values: &[f32], width: usize) {
        assert!(values.len().is_multiple_of(width), "rows of {width} values");
        self.round(values, width);
        self.len = values.len() / width * padded(width);
    }

    /// Writes every row of `width` values to lines of its own.
    fn round(&mut self, values: &[f32], width: usize) {
        let per_row = width.div_ceil(LINE);
        let needed = values.len().div_ceil(width.max(1)) * per_row;
        if self.lines.len() < needed {
            self.lines = Paged::filled(Line([Bf16(0); LINE]), needed);
        }
        Bf16Unit::expected();
        #[cfg(target_arch = "x86_64")]
        for (row, lines) in values
            .chunks(width.max(1))
            .zip(self.lines.chunks_mut(per_row.max(1)))
        {
            // SAFETY: either unit proves that AVX-512 F, BW, VL and BF16 were detected.
            unsafe { round_row(row, lines) };
        }
    }

    /// The numbers of the last call that filled this buffer, in order.
    #[must_use]
    pub fn values(&self) -> &[Bf16] {
        // SAFETY: a line is `LINE` numbers without padding, and `len` is at most the numbers of all lines.
        unsafe { std::slice::from_raw_parts(self.lines.as_ptr().cast(), self.len) }
    }
}

/// The distance between rows of this width with zeros behind them: whole cache lines, and whole steps of a product.
#[must_use]
pub fn padded(width: usize) -> usize {
    width.next_multiple_of(LINE)
}

/// Rounds a row, with zeros to the end of its last line.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512bf16")]
fn round_row(row: &[f32], lines: &mut [Line]) {
    let (whole, rest) = row.as_chunks::<LINE>();
    let (lines, last) = lines.split_at_mut(whole.len());
    for (values, line) in whole.iter().zip(lines) {
        round_line(values, line);
    }
    if let Some(line) = last.first_mut() {
        round_line(rest, line);
    }
}

/// Rounds at most a line of values.
#[cfg(target_arch = "x86_64")]
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512bf16")]
fn round_line(values: &[f32], Line(line): &mut Line) {
    // one bit for each value that there is
    let all = ((1_u64 << values.len()) - 1) as u32;
    // SAFETY: only values that are there are read; a line has room for 32 values of 16 bits.
    unsafe {
        let from = values.as_ptr();
        let low = _mm512_maskz_loadu_ps(all as u16, from);
        let high = _mm512_maskz_loadu_ps((all >> 16) as u16, from.wrapping_add(16));
        let rounded = std::mem::transmute::<__m512bh, __m512i>(_mm512_cvtne2ps_pbh(high, low));
        _mm512_store_si512(line.as_mut_ptr().cast(), rounded);
    }
}
