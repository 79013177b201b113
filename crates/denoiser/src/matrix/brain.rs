//! bf16 products: factors of 8 significant bits, sums in f32.
#![allow(unsafe_code)] // vector instructions, and calling what is compiled for features that were just detected

use super::{Job, PANEL};
#[cfg(target_arch = "x86_64")]
use super::{tiles, vectors};
use crate::paged::Paged;
#[cfg(target_arch = "x86_64")]
use std::arch::x86_64::*;
use std::sync::LazyLock;

/// Pairs of inputs that one tile of weights holds.
pub(super) const STEP_PAIRS: usize = 16;
/// Values in a cache line, which is also how many inputs are multiplied at a time.
pub(super) const LINE: usize = 2 * STEP_PAIRS;

/// A number in bf16: the upper half of the f32 of the same value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(transparent)]
pub struct Brain(pub(super) u16);

impl Brain {
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

    /// The same number in f32.
    #[must_use]
    pub fn widen(self) -> f32 {
        f32::from_bits(u32::from(self.0) << 16)
    }
}

#[derive(Clone, Copy)]
#[repr(C, align(64))]
struct Line([Brain; LINE]);

/// Numbers in bf16 that start on a cache line, which products read fastest when a stride is whole lines too.
#[derive(Default)]
pub struct BrainBuffer {
    lines: Paged<Line>,
    len: usize,
}

impl BrainBuffer {
    /// Becomes `values`, rounded to bf16; allocates only when it grows beyond what it held before.
    ///
    /// # Panics
    ///
    /// When [`Precision::Brain`](super::Precision::Brain) is not available.
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
            self.lines = Paged::filled(Line([Brain(0); LINE]), needed);
        }
        Unit::expected();
        #[cfg(target_arch = "x86_64")]
        for (row, lines) in values
            .chunks(width.max(1))
            .zip(self.lines.chunks_mut(per_row.max(1)))
        {
            // SAFETY: either unit proves that AVX-512 F, BW, VL and BF16 were detected.
            unsafe { round_row(row, lines) };
        }
    }

    /// The numbers.
    #[must_use]
    pub fn values(&self) -> &[Brain] {
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

/// Proof that this processor has AVX-512 F, BW, VL and BF16: only [`Unit::detected`] makes one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bf16Vectors(());

/// Proof that this processor has AMX BF16 beside AVX-512 BF16, and that its tiles may be used: only [`Unit::detected`]
/// makes one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bf16Tiles(());

/// What computes bf16 products; there is a value only of what this processor has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// AVX-512 BF16: pairs of products in vector registers.
    Vectors(Bf16Vectors),
    /// AMX BF16: tiles of products.
    Tiles(Bf16Tiles),
}

static UNITS: LazyLock<Vec<Unit>> = LazyLock::new(|| {
    let mut units = vec![];
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512vl")
        && is_x86_feature_detected!("avx512bf16")
    {
        units.push(Unit::Vectors(Bf16Vectors(())));
        if tiles::available() {
            units.push(Unit::Tiles(Bf16Tiles(())));
        }
    }
    units
});

impl Unit {
    /// The units of this processor, the fastest last.
    #[must_use]
    pub fn detected() -> &'static [Self] {
        &UNITS
    }

    pub(super) fn best() -> Option<Self> {
        UNITS.last().copied()
    }

    /// Whether its products take less time than those in f32: AVX-512 BF16 was measured to have twice their rate on AMD's Zen 4, and
    /// half of it on an Intel Xeon.
    pub(super) fn is_faster_than_single(self) -> bool {
        match self {
            Self::Tiles(_) => true,
            #[cfg(target_arch = "x86_64")]
            Self::Vectors(_) => {
                let CpuidResult { ebx, ecx, edx, .. } = __cpuid(0);
                [ebx, edx, ecx].map(u32::to_le_bytes).as_flattened() == b"AuthenticAMD"
            }
            #[cfg(not(target_arch = "x86_64"))]
            Self::Vectors(_) => false,
        }
    }

    /// The fastest unit, where products in bf16 are known to be available.
    pub(super) fn expected() -> Self {
        Self::best().expect("bf16 is available on this processor")
    }
}

/// The weights of a pair of inputs for the outputs of a panel: `[output in panel][input of the pair]`.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub(super) struct PairWeights(pub(super) [[Brain; 2]; PANEL]);

/// A matrix packed as `[panel][pair of inputs][output in panel][2]`, with zeros up to whole tiles.
pub(super) struct BrainPanels {
    pairs: usize,
    weights: Paged<PairWeights>,
}

impl BrainPanels {
    /// Packs the matrix whose weight for (output, input) `weight` tells.
    pub(super) fn new(inputs: usize, outputs: usize, weight: impl Fn(usize, usize) -> f32) -> Self {
        let pairs = padded(inputs) / 2;
        let mut weights = Paged::filled(
            PairWeights([[Brain(0); 2]; PANEL]),
            outputs.div_ceil(PANEL) * pairs,
        );
        for output in 0..outputs {
            for input in 0..inputs {
                let pair = output / PANEL * pairs + input / 2;
                weights[pair].0[output % PANEL][input % 2] = Brain::round(weight(output, input));
            }
        }
        Self { pairs, weights }
    }

    /// Computes with a unit.
    pub(super) fn multiply(&self, unit: Unit, job: Job<'_, Brain>) {
        match unit {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: the unit proves that AVX-512 F, BW, VL and BF16 were detected.
            Unit::Vectors(_) => unsafe { vectors::multiply(self, job) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: the unit proves that tiles are available.
            Unit::Tiles(_) => unsafe { tiles::multiply(self, job) },
            #[cfg(not(target_arch = "x86_64"))]
            unit => unreachable!("{unit:?} is of x86-64, not for {} rows", job.batch.rows),
        }
    }

    /// The weights for the outputs of a panel.
    pub(super) fn panel(&self, panel: usize) -> &[PairWeights] {
        &self.weights[panel * self.pairs..][..self.pairs]
    }
}
