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
/// Values in a cache line.
const LINE: usize = 32;

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
        let needed = values.len().div_ceil(LINE);
        if self.lines.len() < needed {
            self.lines = Paged::filled(Line([Brain(0); LINE]), needed);
        }
        self.len = values.len();
        assert!(
            Unit::best().is_some(),
            "bf16 is available on this processor"
        );
        #[cfg(target_arch = "x86_64")]
        // SAFETY: a unit exists only where AVX-512 F, BW, VL and BF16 were detected.
        unsafe {
            round_all(values, self.values_mut());
        }
    }

    /// The numbers.
    #[must_use]
    pub fn values(&self) -> &[Brain] {
        // SAFETY: a line is `LINE` numbers without padding, and `len` is at most the numbers of all lines.
        unsafe { std::slice::from_raw_parts(self.lines.as_ptr().cast(), self.len) }
    }

    fn values_mut(&mut self) -> &mut [Brain] {
        // SAFETY: as above.
        unsafe { std::slice::from_raw_parts_mut(self.lines.as_mut_ptr().cast(), self.len) }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512bf16")]
fn round_all(values: &[f32], out: &mut [Brain]) {
    let (chunks, rest) = values.as_chunks::<LINE>();
    let (out_chunks, out_rest) = out.as_chunks_mut::<LINE>();
    for (chunk, out) in chunks.iter().zip(out_chunks) {
        // SAFETY: a chunk has two times 16 values to read and as many to write, of 16 bits each.
        unsafe {
            let low = _mm512_loadu_ps(chunk.as_ptr());
            let high = _mm512_loadu_ps(chunk.as_ptr().add(16));
            let rounded = std::mem::transmute::<__m512bh, __m512i>(_mm512_cvtne2ps_pbh(high, low));
            _mm512_storeu_si512(out.as_mut_ptr().cast(), rounded);
        }
    }
    for (value, out) in rest.iter().zip(out_rest) {
        *out = Brain::round(*value);
    }
}

/// What computes bf16 products.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// AVX-512 BF16: pairs of products in vector registers.
    Vectors,
    /// AMX BF16: tiles of products.
    Tiles,
}

static UNITS: LazyLock<Vec<Unit>> = LazyLock::new(|| {
    let mut units = vec![];
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512vl")
        && is_x86_feature_detected!("avx512bf16")
    {
        units.push(Unit::Vectors);
        if tiles::available() {
            units.push(Unit::Tiles);
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
}

/// The weights of a pair of inputs for the outputs of a panel: `[output in panel][input of the pair]`.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub(super) struct PairWeights(pub(super) [[Brain; 2]; PANEL]);

/// A matrix packed as `[panel][pair of inputs][output in panel][2]`, with zeros up to whole tiles.
pub(super) struct BrainPanels {
    pub(super) inputs: usize,
    weights: Paged<PairWeights>,
}

impl BrainPanels {
    /// Packs the matrix whose weight for (output, input) `weight` tells.
    pub(super) fn new(inputs: usize, outputs: usize, weight: impl Fn(usize, usize) -> f32) -> Self {
        let pairs = padded_pairs(inputs);
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
        Self { inputs, weights }
    }

    /// Computes with a unit, which must be [detected](Unit::detected).
    pub(super) fn multiply(&self, unit: Unit, job: Job<'_, Brain>) {
        let is_detected = Unit::detected().contains(&unit);
        assert!(is_detected, "this processor has no {unit:?} for bf16");
        match unit {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: AVX-512 F, BW, VL and BF16 were detected: asserted above.
            Unit::Vectors => unsafe { vectors::multiply(self, job) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: tiles are available: asserted above.
            Unit::Tiles => unsafe { tiles::multiply(self, job) },
            #[cfg(not(target_arch = "x86_64"))]
            unit => unreachable!("{unit:?} is of x86-64, not for {} rows", job.batch.rows),
        }
    }

    /// The weights for the outputs of a panel.
    pub(super) fn panel(&self, panel: usize) -> &[PairWeights] {
        let pairs = padded_pairs(self.inputs);
        &self.weights[panel * pairs..][..pairs]
    }
}

/// Pairs of inputs, rounded up to whole tiles.
fn padded_pairs(inputs: usize) -> usize {
    inputs.div_ceil(2).next_multiple_of(STEP_PAIRS)
}
