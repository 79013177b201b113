//! SiLU with a vectorised exponential.

use crate::simd::{Kernel, Level, dispatch, multiply_add};

/// Replaces every value x by x / (1 + e^−x).
pub(crate) fn silu(values: &mut [f32]) {
    dispatch(Silu { values });
}

struct Silu<'a> {
    values: &'a mut [f32],
}

impl Kernel for Silu<'_> {
    #[inline(always)]
    fn run<L: Level>(self) {
        for v in self.values {
            *v /= 1.0 + exponential::<L>(-*v);
        }
    }
}

/// e^x with a relative error below 2e-7, for x in [−87, 87] (clamped): 2^n times a polynomial on |r| ≤ ln 2 / 2.
#[inline(always)]
fn exponential<L: Level>(x: f32) -> f32 {
    /// Adding and subtracting 1.5 · 2²³ rounds to the nearest integer.
    const ROUND: f32 = 12_582_912.0;
    const LN2_HIGH: f32 = 0.693_359_4;
    const LN2_LOW: f32 = -2.121_944_4e-4;
    let x = x.clamp(-87.0, 87.0);
    let shifted = multiply_add::<L>(x, std::f32::consts::LOG2_E, ROUND);
    let n = shifted - ROUND;
    let r = multiply_add::<L>(n, -LN2_HIGH, x);
    let r = multiply_add::<L>(n, -LN2_LOW, r);
    let mut p = 1.987_569_1e-4;
    for coefficient in [
        1.398_199_9e-3,
        8.333_452e-3,
        4.166_579_6e-2,
        1.666_666_5e-1,
        0.5,
    ] {
        p = multiply_add::<L>(p, r, coefficient);
    }
    let fraction = multiply_add::<L>(p * r, r, r) + 1.0;
    let exponent = (shifted.to_bits().wrapping_sub(ROUND.to_bits())).wrapping_add(127) << 23;
    fraction * f32::from_bits(exponent)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::Plain;

    #[test]
    fn the_exponential_is_accurate_over_its_range() {
        for i in -8600..=8600 {
            let x = i as f32 / 100.0;
            let relative = (f64::from(exponential::<Plain>(x)) / f64::from(x).exp() - 1.0).abs();
            assert!(relative < 2e-7, "e^{x} is off by {relative}");
        }
    }

    #[test]
    fn silu_agrees_with_its_definition_and_survives_extremes() {
        let given = [-1e9_f32, -80.0, -1.0, 0.0, 1.0, 80.0, 1e9];
        let mut values = given;
        silu(&mut values);
        for (y, x) in values.iter().zip(given) {
            let expected = f64::from(x) / (1.0 + (-f64::from(x)).exp());
            assert!(
                (f64::from(*y) - expected).abs() <= 1e-6 * expected.abs().max(1e-6),
                "silu({x}) = {y}"
            );
        }
    }
}
