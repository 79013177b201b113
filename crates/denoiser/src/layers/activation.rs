//! SiLU with a vectorised exponential.

use crate::simd::dispatch::{Kernel, dispatch};
use crate::simd::lanes::{LANES, Lanes, ROUND};

/// Replaces every value x by x / (1 + e^−x).
pub(crate) fn silu(values: &mut [f32]) {
    dispatch(Silu { values });
}

struct Silu<'a> {
    values: &'a mut [f32],
}

impl Kernel for Silu<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let (chunks, rest) = self.values.as_chunks_mut::<LANES>();
        for chunk in chunks {
            silu_of(lanes, chunk);
        }
        let mut last = [0.0; LANES];
        last[..rest.len()].copy_from_slice(rest);
        silu_of(lanes, &mut last);
        rest.copy_from_slice(&last[..rest.len()]);
    }
}

/// A function and not a closure: that would be compiled without the level's features, each instruction a call.
#[inline(always)]
fn silu_of<L: Lanes>(lanes: L, values: &mut [f32; LANES]) {
    let x = lanes.get(values);
    lanes.put(lanes.mul(x, sigmoid(lanes, x)), values);
}

/// 1 / (1 + e^−x).
#[inline(always)]
pub(crate) fn sigmoid<L: Lanes>(lanes: L, x: L::Values) -> L::Values {
    let one = lanes.splat(1.0);
    let negative = lanes.sub(lanes.splat(0.0), x);
    lanes.inverse(lanes.add(one, exponential(lanes, negative)))
}

/// e^x with a relative error below 2e-7, for x in [−87, 87] (clamped): 2^n times a polynomial on |r| ≤ ln 2 / 2.
#[inline(always)]
fn exponential<L: Lanes>(lanes: L, x: L::Values) -> L::Values {
    const LN2_HIGH: f32 = 0.693_359_4;
    const LN2_LOW: f32 = -2.121_944_4e-4;
    let x = lanes.max(lanes.splat(-87.0), lanes.min(lanes.splat(87.0), x));
    let shifted = lanes.fma(x, lanes.splat(std::f32::consts::LOG2_E), lanes.splat(ROUND));
    let n = lanes.sub(shifted, lanes.splat(ROUND));
    let r = lanes.fma(n, lanes.splat(-LN2_HIGH), x);
    let r = lanes.fma(n, lanes.splat(-LN2_LOW), r);
    let mut p = lanes.splat(1.987_569_1e-4);
    for coefficient in [
        1.398_199_9e-3,
        8.333_452e-3,
        4.166_579_6e-2,
        1.666_666_5e-1,
        0.5,
    ] {
        p = lanes.fma(p, r, lanes.splat(coefficient));
    }
    let fraction = lanes.add(lanes.fma(lanes.mul(p, r), r, r), lanes.splat(1.0));
    lanes.mul(fraction, lanes.power_of_two(shifted))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::dispatch::{detected_levels, run_at};
    use crate::simd::token::Plain;

    #[test]
    fn the_exponential_is_accurate_over_its_range() {
        for i in -8600..=8600 {
            let x = i as f32 / 100.0;
            let found = exponential(Plain, [x; LANES])[0];
            let relative = (f64::from(found) / f64::from(x).exp() - 1.0).abs();
            assert!(relative < 2e-7, "e^{x} is off by {relative}");
        }
    }

    #[test]
    fn silu_agrees_with_its_definition_and_survives_extremes() {
        let given = [-1e9_f32, -80.0, -1.0, 0.0, 1.0, 80.0, 1e9].repeat(3);
        for level in detected_levels() {
            let mut values = given.clone();
            let kernel = Silu {
                values: &mut values,
            };
            run_at(level, kernel);
            for (y, x) in values.iter().zip(&given) {
                let expected = f64::from(*x) / (1.0 + (-f64::from(*x)).exp());
                assert!(
                    (f64::from(*y) - expected).abs() <= 1e-6 * expected.abs().max(1e-6),
                    "silu({x}) = {y}"
                );
            }
        }
    }
}
