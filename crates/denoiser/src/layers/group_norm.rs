//! Group normalisation, a factor and a summand for each channel, and SiLU in one pass; and the gradient of the whole.
//!
//! Each of [`GROUPS`] groups of channels is normalised over its channels and all frames of one candidate.

use crate::layers::activation::sigmoid;
use crate::layers::convolution::Rows;
use crate::simd::dispatch::{Kernel, dispatch};
use crate::simd::lanes::{LANES, Lanes};
use crate::simd::prefetch::prefetch;
use crate::weights::error::WeightsError;
use crate::weights::file::WeightsFile;

/// Groups of channels that are normalised together.
pub(crate) const GROUPS: usize = 8;
/// The ε that keeps the divisor from zero: PyTorch's default.
const EPSILON: f32 = 1e-5;

/// Factor and summand of each channel, applied after the normalisation.
#[derive(Clone, Default)]
pub(crate) struct Affine {
    pub(crate) gain: Vec<f32>,
    pub(crate) offset: Vec<f32>,
}

impl Affine {
    /// Loads `name`.weight and `name`.bias.
    pub(crate) fn load(
        file: &WeightsFile,
        name: &str,
        channels: usize,
    ) -> Result<Self, WeightsError> {
        Ok(Self {
            gain: file.vector(&format!("{name}.weight"), channels)?,
            offset: file.vector(&format!("{name}.bias"), channels)?,
        })
    }
}

/// Means and scales of a normalisation, for its gradient: candidates × channels, where the channels of a group share their values.
#[derive(Default)]
pub(crate) struct Statistics {
    mean: Vec<f32>,
    /// 1 / √(variance + ε).
    scale: Vec<f32>,
}

/// out = SiLU(normalised(x) · gain + offset); notes the statistics for [`pull_back`], and copies x if asked to.
pub(crate) fn apply(
    x: &Rows,
    affine: &Affine,
    statistics: &mut Statistics,
    out: &mut Rows,
    copy: Option<&mut Rows>,
) {
    assert_eq!(affine.gain.len(), x.channels(), "channels");
    assert_eq!(x.channels() % LANES, 0, "whole registers");
    let mut copy = copy;
    for out in std::iter::once(&mut *out).chain(copy.as_deref_mut()) {
        out.shape(x.candidates(), x.height(), x.channels());
    }
    for values in [&mut statistics.mean, &mut statistics.scale] {
        values.resize(x.candidates() * x.channels(), 0.0);
    }
    dispatch(Forward {
        x,
        affine,
        statistics,
        out,
        copy,
    });
}

/// Turns the gradient with respect to the output of [`apply`] into that with respect to its input, in place.
///
/// `copied` is the gradient with respect to the copy of the input, if there is one.
pub(crate) fn pull_back(
    x: &Rows,
    affine: &Affine,
    statistics: &Statistics,
    gradient: &mut Rows,
    copied: Option<&Rows>,
    sums: &mut [Vec<f32>; 2],
) {
    for sum in sums.iter_mut() {
        sum.resize(x.channels(), 0.0);
    }
    dispatch(Backward {
        x,
        affine,
        statistics,
        gradient,
        copied,
        sums,
    });
}

struct Forward<'a> {
    x: &'a Rows,
    affine: &'a Affine,
    statistics: &'a mut Statistics,
    out: &'a mut Rows,
    copy: Option<&'a mut Rows>,
}

impl Kernel for Forward<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let channels = self.x.channels();
        let means = self.statistics.mean.chunks_exact_mut(channels);
        let scales = self.statistics.scale.chunks_exact_mut(channels);
        let candidates = self.x.each().zip(self.out.each_mut());
        let mut copies = self.copy.map(Rows::each_mut);
        for ((x, out), (mean, scale)) in candidates.zip(means.zip(scales)) {
            measure(lanes, x, mean, scale);
            let copy = copies.as_mut().and_then(Iterator::next);
            activate(
                lanes,
                x,
                (self.affine, mean, scale),
                out,
                copy.unwrap_or(&mut []),
            );
        }
    }
}

/// Mean and scale of each group of height × channels values.
#[inline(always)]
fn measure<L: Lanes>(lanes: L, x: &[f32], mean: &mut [f32], scale: &mut [f32]) {
    let channels = mean.len();
    let share = GROUPS as f32 / x.len() as f32;
    for first in (0..channels).step_by(LANES) {
        let sums = sum_rows(lanes, x, channels, first, |v| v);
        lanes.put(sums, part_mut(mean, first));
    }
    join_groups(mean, |sum| sum * share);
    for first in (0..channels).step_by(LANES) {
        let centre = lanes.get(part(mean, first));
        let square = |v| {
            let d = lanes.sub(v, centre);
            lanes.mul(d, d)
        };
        lanes.put(
            sum_rows(lanes, x, channels, first, square),
            part_mut(scale, first),
        );
    }
    join_groups(scale, |sum| 1.0 / (sum * share + EPSILON).sqrt());
}

/// Writes the activations, and x itself unless `copy` is empty.
#[inline(always)]
fn activate<L: Lanes>(
    lanes: L,
    x: &[f32],
    (affine, mean, scale): (&Affine, &[f32], &[f32]),
    out: &mut [f32],
    copy: &mut [f32],
) {
    let channels = mean.len();
    for first in (0..channels).step_by(LANES) {
        let (factor, summand) = folded(lanes, affine, mean, scale, first);
        let rows = x.chunks_exact(channels);
        let mut copies = copy.chunks_exact_mut(channels);
        for (x, out) in rows.zip(out.chunks_exact_mut(channels)) {
            let x = lanes.get(part(x, first));
            let y = lanes.fma(x, factor, summand);
            lanes.put(lanes.mul(y, sigmoid(lanes, y)), part_mut(out, first));
            if let Some(copy) = copies.next() {
                lanes.put(x, part_mut(copy, first));
            }
        }
    }
}

/// Normalisation and affine map as one factor and one summand.
#[inline(always)]
fn folded<L: Lanes>(
    lanes: L,
    affine: &Affine,
    mean: &[f32],
    scale: &[f32],
    first: usize,
) -> (L::Values, L::Values) {
    let factor = lanes.mul(
        lanes.get(part(&affine.gain, first)),
        lanes.get(part(scale, first)),
    );
    let centre = lanes.mul(lanes.get(part(mean, first)), factor);
    (
        factor,
        lanes.sub(lanes.get(part(&affine.offset, first)), centre),
    )
}

struct Backward<'a> {
    x: &'a Rows,
    affine: &'a Affine,
    statistics: &'a Statistics,
    gradient: &'a mut Rows,
    copied: Option<&'a Rows>,
    sums: &'a mut [Vec<f32>; 2],
}

impl Kernel for Backward<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let channels = self.x.channels();
        let means = self.statistics.mean.chunks_exact(channels);
        let scales = self.statistics.scale.chunks_exact(channels);
        let candidates = self.x.each().zip(self.gradient.each_mut());
        let mut copied = self.copied.map(Rows::each);
        for ((x, gradient), (mean, scale)) in candidates.zip(means.zip(scales)) {
            let normalised = Normalised {
                x,
                pitch: self.x.pitch(),
                mean,
                scale,
            };
            normalised.through_activation(lanes, self.affine, gradient, self.sums);
            let copied = copied.as_mut().and_then(Iterator::next);
            normalised.through_norm(lanes, gradient, copied.unwrap_or(&[]), self.sums);
        }
    }
}

/// One candidate's input of a normalisation, with its means and scales.
struct Normalised<'a> {
    x: &'a [f32],
    /// Values from this candidate's input to the next one's, which has long left the near caches when it is needed.
    pitch: usize,
    mean: &'a [f32],
    scale: &'a [f32],
}

impl Normalised<'_> {
    /// Carries the gradient back through SiLU and the affine map; leaves the averages of the gradient, and of gradient · normalised x.
    #[inline(always)]
    fn through_activation<L: Lanes>(
        &self,
        lanes: L,
        affine: &Affine,
        gradient: &mut [f32],
        sums: &mut [Vec<f32>; 2],
    ) {
        let Self { x, mean, scale, .. } = *self;
        let channels = mean.len();
        let one = lanes.splat(1.0);
        for first in (0..channels).step_by(LANES) {
            let (factor, summand) = folded(lanes, affine, mean, scale, first);
            let gain = lanes.get(part(&affine.gain, first));
            let centre = lanes.get(part(mean, first));
            let (mut total, mut along) = (lanes.splat(0.0), lanes.splat(0.0));
            let rows = x.chunks_exact(channels);
            for (x, g) in rows.zip(gradient.chunks_exact_mut(channels)) {
                let x = part(x, first);
                prefetch(x.as_ptr().wrapping_add(self.pitch));
                let x = lanes.get(x);
                let y = lanes.fma(x, factor, summand);
                let s = sigmoid(lanes, y);
                // SiLU' = s + y s (1 − s)
                let slope = lanes.fma(lanes.mul(y, s), lanes.sub(one, s), s);
                let d = lanes.mul(lanes.mul(lanes.get(part(g, first)), slope), gain);
                total = lanes.add(total, d);
                along = lanes.fma(d, lanes.sub(x, centre), along);
                lanes.put(d, part_mut(g, first));
            }
            lanes.put(total, part_mut(&mut sums[0], first));
            let along = lanes.mul(along, lanes.get(part(scale, first)));
            lanes.put(along, part_mut(&mut sums[1], first));
        }
        let share = GROUPS as f32 / x.len() as f32;
        for sum in sums {
            join_groups(sum, |sum| sum * share);
        }
    }

    /// Carries the gradient back through the normalisation: scale · (g − average g − normalised x · average (g · normalised x)), and adds the
    /// gradient of the copy unless that is empty.
    #[inline(always)]
    fn through_norm<L: Lanes>(
        &self,
        lanes: L,
        gradient: &mut [f32],
        copied: &[f32],
        averages: &[Vec<f32>; 2],
    ) {
        let channels = self.mean.len();
        for first in (0..channels).step_by(LANES) {
            let at = |values: &[f32]| lanes.get(part(values, first));
            let (mean, scale) = (at(self.mean), at(self.scale));
            // g · scale + x · slope + rest
            let slope = lanes.mul(lanes.mul(scale, scale), at(&averages[1]));
            let slope = lanes.sub(lanes.splat(0.0), slope);
            let rest = lanes.fma(mean, slope, lanes.mul(scale, at(&averages[0])));
            let rest = lanes.sub(lanes.splat(0.0), rest);
            let rows = self.x.chunks_exact(channels);
            let mut copied = copied.chunks_exact(channels);
            for (x, g) in rows.zip(gradient.chunks_exact_mut(channels)) {
                let along = lanes.fma(lanes.get(part(x, first)), slope, rest);
                let mut d = lanes.fma(lanes.get(part(g, first)), scale, along);
                if let Some(copied) = copied.next() {
                    d = lanes.add(d, lanes.get(part(copied, first)));
                }
                lanes.put(d, part_mut(g, first));
            }
        }
    }
}

/// Sums a function of the values of some channels over all rows, in a fixed order.
#[inline(always)]
fn sum_rows<L: Lanes>(
    lanes: L,
    x: &[f32],
    channels: usize,
    first: usize,
    of: impl Fn(L::Values) -> L::Values,
) -> L::Values {
    /// Independent chains of additions.
    const CHAINS: usize = 4;
    let mut sums = [lanes.splat(0.0); CHAINS];
    let blocks = x.chunks_exact(CHAINS * channels);
    assert!(blocks.remainder().is_empty(), "rows in fours");
    for block in blocks {
        for (sum, row) in sums.iter_mut().zip(block.chunks_exact(channels)) {
            *sum = lanes.add(*sum, of(lanes.get(part(row, first))));
        }
    }
    lanes.add(lanes.add(sums[0], sums[1]), lanes.add(sums[2], sums[3]))
}

/// Replaces each channel's value by a function of the sum over its group.
#[inline(always)]
fn join_groups(values: &mut [f32], of: impl Fn(f32) -> f32) {
    let width = values.len() / GROUPS;
    for group in values.chunks_exact_mut(width) {
        let sum = group.iter().sum();
        group.fill(of(sum));
    }
}

#[inline(always)]
fn part(values: &[f32], first: usize) -> &[f32; LANES] {
    values[first..]
        .first_chunk()
        .expect("channels come in whole registers")
}

#[inline(always)]
fn part_mut(values: &mut [f32], first: usize) -> &mut [f32; LANES] {
    values[first..]
        .first_chunk_mut()
        .expect("channels come in whole registers")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::dispatch::{detected_levels, run_at};

    const HEIGHT: usize = 8;
    const CHANNELS: usize = 32;
    const SIZE: usize = HEIGHT * CHANNELS;

    /// Numbers without a pattern that a wrong index could hide in.
    fn scattered(count: usize, seed: u32) -> Vec<f32> {
        let value = |i: u32| (i.wrapping_mul(2_654_435_761).wrapping_add(seed) >> 8) as f32;
        (0..count as u32)
            .map(|i| value(i) / 4_194_304.0 - 2.0)
            .collect()
    }

    fn rows(values: &[f32]) -> Rows {
        let mut rows = Rows::default();
        rows.shape(values.len() / SIZE, HEIGHT, CHANNELS);
        for (rows, values) in rows.each_mut().zip(values.chunks_exact(SIZE)) {
            rows.copy_from_slice(values);
        }
        rows
    }

    fn affine() -> Affine {
        Affine {
            gain: scattered(CHANNELS, 5),
            offset: scattered(CHANNELS, 6),
        }
    }

    /// The definition, for one candidate.
    fn definition(x: &[f64]) -> Vec<f64> {
        let Affine { gain, offset } = affine();
        let width = CHANNELS / GROUPS;
        let mut out = vec![0.0; SIZE];
        for group in 0..GROUPS {
            let members: Vec<usize> = (0..SIZE)
                .filter(|i| i % CHANNELS / width == group)
                .collect();
            let average = |of: &dyn Fn(f64) -> f64| {
                members.iter().map(|i| of(x[*i])).sum::<f64>() / members.len() as f64
            };
            let mean = average(&|v| v);
            let variance = average(&|v| (v - mean).powi(2));
            for i in members {
                let normalised = (x[i] - mean) / (variance + f64::from(EPSILON)).sqrt();
                let (gain, offset) = (gain[i % CHANNELS], offset[i % CHANNELS]);
                let y = normalised * f64::from(gain) + f64::from(offset);
                out[i] = y / (1.0 + (-y).exp());
            }
        }
        out
    }

    fn wide(values: &[f32]) -> Vec<f64> {
        values.iter().map(|v| f64::from(*v)).collect()
    }

    #[test]
    fn every_level_agrees_with_the_definition_and_its_derivative() {
        const CHANGE: f64 = 1e-5;
        let (x, cotangent) = (scattered(2 * SIZE, 1), scattered(2 * SIZE, 2));
        let (x_rows, affine) = (rows(&x), affine());
        for level in detected_levels() {
            let mut statistics = Statistics {
                mean: vec![0.0; 2 * CHANNELS],
                scale: vec![0.0; 2 * CHANNELS],
            };
            let (mut out, mut copy) = (rows(&cotangent), rows(&cotangent));
            let forward = Forward {
                x: &x_rows,
                affine: &affine,
                statistics: &mut statistics,
                out: &mut out,
                copy: Some(&mut copy),
            };
            run_at(level, forward);
            let mut gradient = rows(&cotangent);
            let backward = Backward {
                x: &x_rows,
                affine: &affine,
                statistics: &statistics,
                gradient: &mut gradient,
                copied: None,
                sums: &mut [vec![0.0; CHANNELS], vec![0.0; CHANNELS]],
            };
            run_at(level, backward);
            let found = out.each().zip(copy.each()).zip(gradient.each());
            let given = x.chunks_exact(SIZE).zip(cotangent.chunks_exact(SIZE));
            for (((out, copy), gradient), (x, cotangent)) in found.zip(given) {
                assert_eq!(copy, x);
                let (x, cotangent) = (wide(x), wide(cotangent));
                for (found, expected) in out.iter().zip(definition(&x)) {
                    assert!((f64::from(*found) - expected).abs() < 1e-5);
                }
                let value_at = |i: usize, change: f64| {
                    let mut x = x.clone();
                    x[i] += change;
                    let terms = definition(&x).into_iter().zip(&cotangent);
                    terms.map(|(y, c)| y * c).sum::<f64>()
                };
                for i in (0..SIZE).step_by(13) {
                    let difference = (value_at(i, CHANGE) - value_at(i, -CHANGE)) / (2.0 * CHANGE);
                    let error = (f64::from(gradient[i]) - difference).abs();
                    assert!(error < 1e-4, "{} for {difference}", gradient[i]);
                }
            }
        }
    }
}
