//! Eight numbers side by side: one component of eight configurations.
//!
//! Only plain additions, products, quotients and square roots, never fused: the result is the same bit for bit whatever
//! vectors the compiler makes of them.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// Numbers handled together.
pub(super) const LANES: usize = 8;

/// Eight numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(64))]
pub(super) struct Lanes(pub(super) [f64; LANES]);

impl Lanes {
    #[inline(always)]
    pub(super) fn splat(value: f64) -> Self {
        Self([value; LANES])
    }

    /// The eight numbers from `at` on.
    #[inline(always)]
    pub(super) fn load(values: &[f64], at: usize) -> Self {
        let mut lanes = [0.0; LANES];
        lanes.copy_from_slice(&values[at..at + LANES]);
        Self(lanes)
    }

    #[inline(always)]
    pub(super) fn store(self, values: &mut [f64], at: usize) {
        values[at..at + LANES].copy_from_slice(&self.0);
    }

    #[inline(always)]
    pub(super) fn sqrt(self) -> Self {
        self.map(f64::sqrt)
    }

    /// The smaller number of each lane; `self` where they are not comparable.
    #[inline(always)]
    pub(super) fn min(self, other: Self) -> Self {
        self.zip(other, |a, b| if b < a { b } else { a })
    }

    /// `then` in the lanes where `self` is below `bound`, else `otherwise`.
    #[inline(always)]
    pub(super) fn choose_below(self, bound: Self, then: Self, otherwise: Self) -> Self {
        let mut out = otherwise;
        for i in 0..LANES {
            out.0[i] = if self.0[i] < bound.0[i] {
                then.0[i]
            } else {
                otherwise.0[i]
            };
        }
        out
    }

    /// Whether any lane is above a number.
    #[inline(always)]
    pub(super) fn any_above(self, bound: f64) -> bool {
        self.0.iter().fold(false, |any, v| any | (*v > bound))
    }

    #[inline(always)]
    fn map(self, operation: impl Fn(f64) -> f64) -> Self {
        let mut out = self;
        for value in &mut out.0 {
            *value = operation(*value);
        }
        out
    }

    #[inline(always)]
    fn zip(self, other: Self, operation: impl Fn(f64, f64) -> f64) -> Self {
        let mut out = self;
        for i in 0..LANES {
            out.0[i] = operation(self.0[i], other.0[i]);
        }
        out
    }
}

impl Add for Lanes {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.zip(other, |a, b| a + b)
    }
}

impl Sub for Lanes {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.zip(other, |a, b| a - b)
    }
}

impl Mul for Lanes {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.zip(other, |a, b| a * b)
    }
}

impl Div for Lanes {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self.zip(other, |a, b| a / b)
    }
}

impl Mul<f64> for Lanes {
    type Output = Self;
    #[inline(always)]
    fn mul(self, factor: f64) -> Self {
        self.map(|a| a * factor)
    }
}

impl Neg for Lanes {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.map(|a| -a)
    }
}
