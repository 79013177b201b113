//! One section: a circular arc as a function of its bending pair, regular at zero.
//!
//! Everything follows from S = sin(θ/2)/(θ/2) and c = cos(θ/2), which lose no digits: A = sin θ/θ = S c,
//! B = (1 − cos θ)/θ² = S²/2. Up to the bending that robots have both are sums of a few terms of their series in θ².

use crate::{Configuration, SECTIONS};
use fearless_simd::f64x4;
use fearless_simd::prelude::*;
use nalgebra::{Matrix3, Vector3};

/// Below this squared angle the two quotients that cancel are computed by series (truncation below 1e-15).
const SERIES_BELOW: f64 = 0.06;

/// Below this (θ/2)², θ < 1.67 rad, S and c are summed (truncation below 1e-17).
const SUMMED_BELOW: f64 = 0.7;

/// Number of terms of the series of S and c.
const TERMS: usize = 10;
/// Coefficients of the series of S and of c, but for their signs: 1/(2n + 1)! and 1/(2n)!.
const SERIES: [[f64; TERMS]; 2] = [reciprocal_factorials(1), reciprocal_factorials(0)];

const fn reciprocal_factorials(odd: usize) -> [f64; TERMS] {
    let (mut terms, mut factorial, mut n) = ([1.0; TERMS], 1.0, 1);
    while n < TERMS {
        let k = (2 * n + odd) as f64;
        factorial *= k * (k - 1.0);
        terms[n] = 1.0 / factorial;
        n += 1;
    }
    terms
}

/// S = sin(θ/2)/(θ/2) and c = cos(θ/2) from h² = (θ/2)².
fn half_sinc_and_cosine(h2: f64) -> [f64; 2] {
    if h2 < SUMMED_BELOW {
        SERIES.map(|terms| terms.iter().rev().fold(0.0, |sum, term| term - h2 * sum))
    } else {
        let half = h2.sqrt();
        let (sine, cosine) = half.sin_cos();
        [sine / half, cosine]
    }
}

/// S, c and dS/ds from four h² = (θ/2)² at once, s = θ².
#[inline(always)]
pub(crate) fn half_sincs_cosines_and_slopes<S: Simd>(h2: f64x4<S>) -> [f64x4<S>; 3] {
    let nothing = h2 * 0.0;
    let (mut sinc, mut cosine, mut slope) = (nothing, nothing, nothing);
    for n in (0..TERMS).rev() {
        slope = sinc - h2 * slope;
        sinc = SERIES[0][n] - h2 * sinc;
        cosine = SERIES[1][n] - h2 * cosine;
    }
    slope *= -0.25;
    let mut beyond = (!h2.simd_lt(SUMMED_BELOW)).to_bitmask();
    while beyond != 0 {
        let lane = beyond.trailing_zeros() as usize;
        let values = half_sinc_and_cosine(h2[lane]);
        [sinc[lane], cosine[lane]] = values;
        slope[lane] = half_sinc_slope(4.0 * h2[lane], values);
        beyond &= beyond - 1;
    }
    [sinc, cosine, slope]
}

/// dS/ds from s = θ², S and c.
fn half_sinc_slope(s: f64, [half_sinc, half_cosine]: [f64; 2]) -> f64 {
    if s < SERIES_BELOW {
        let h = 0.25 * s;
        (-1.0 + h / 10.0 * (1.0 - h / 28.0 * (1.0 - h / 54.0 * (1.0 - h / 88.0)))) / 24.0
    } else {
        (half_cosine - half_sinc) / (2.0 * s)
    }
}

/// S and c of each section from its h² = (θ/2)².
#[inline(always)]
fn half_sincs_and_cosines(h2: &[f64; SECTIONS]) -> [[f64; SECTIONS]; 2] {
    if h2.iter().all(|&h2| h2 < SUMMED_BELOW) {
        SERIES.map(|terms| {
            let mut sums = [0.0; SECTIONS];
            for term in terms.iter().rev() {
                for (sum, h2) in sums.iter_mut().zip(h2) {
                    *sum = term - h2 * *sum;
                }
            }
            sums
        })
    } else {
        let each = h2.map(half_sinc_and_cosine);
        [each.map(|[sinc, _]| sinc), each.map(|[_, cosine]| cosine)]
    }
}

/// The part of a section between its base and a fraction of it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Arc {
    /// Bending pair, rad.
    pub(crate) x: f64,
    pub(crate) y: f64,
    /// Arc length.
    pub(crate) length: f64,
    /// Bending angle θ, rad.
    pub(crate) angle: f64,
    /// S = sin(θ/2)/(θ/2).
    half_sinc: f64,
    /// c = cos(θ/2).
    half_cosine: f64,
}

impl Arc {
    pub(crate) fn new(x: f64, y: f64, length: f64) -> Self {
        let square = x * x + y * y;
        Self::with(x, y, length, half_sinc_and_cosine(0.25 * square))
    }

    /// All sections of a configuration (rad) together, the same bits as by [`Self::new`].
    #[inline(always)]
    pub(crate) fn of_sections(
        lengths: &[f64; SECTIONS],
        configuration: &Configuration,
    ) -> [Self; SECTIONS] {
        let pairs: [[f64; 2]; SECTIONS] =
            std::array::from_fn(|i| [configuration[2 * i], configuration[2 * i + 1]]);
        let [sincs, cosines] = half_sincs_and_cosines(&pairs.map(|[x, y]| 0.25 * (x * x + y * y)));
        std::array::from_fn(|i| {
            let [x, y] = pairs[i];
            Self::with(x, y, lengths[i], [sincs[i], cosines[i]])
        })
    }

    #[inline(always)]
    fn with(x: f64, y: f64, length: f64, [half_sinc, half_cosine]: [f64; 2]) -> Self {
        Self {
            x,
            y,
            length,
            angle: (x * x + y * y).sqrt(),
            half_sinc,
            half_cosine,
        }
    }

    /// The part of the section from its base to a fraction of it.
    pub(crate) fn part(&self, fraction: f64) -> Self {
        Self::new(fraction * self.x, fraction * self.y, fraction * self.length)
    }

    fn a(&self) -> f64 {
        self.half_sinc * self.half_cosine
    }

    fn b(&self) -> f64 {
        0.5 * self.half_sinc * self.half_sinc
    }

    /// dA/ds and dB/ds at s = θ².
    fn slopes(&self) -> (f64, f64) {
        let s = self.angle * self.angle;
        let half_sinc_slope = half_sinc_slope(s, [self.half_sinc, self.half_cosine]);
        let a = half_sinc_slope * self.half_cosine - 0.125 * self.half_sinc * self.half_sinc;
        (a, self.half_sinc * half_sinc_slope)
    }

    /// (1 − A)/θ².
    fn one_minus_a_quotient(&self) -> f64 {
        let s = self.angle * self.angle;
        if s < SERIES_BELOW {
            (1.0 - s / 20.0 * (1.0 - s / 42.0 * (1.0 - s / 72.0 * (1.0 - s / 110.0)))) / 6.0
        } else {
            (1.0 - self.a()) / s
        }
    }

    /// Rotation from the base to the end: I + A ŵ + B ŵ², w = (x, y, 0).
    pub(crate) fn rotation(&self) -> Matrix3<f64> {
        let (a, b) = (self.a(), self.b());
        let (xx, yy, xy) = (
            b * self.x * self.x,
            b * self.y * self.y,
            b * self.x * self.y,
        );
        let (ax, ay) = (a * self.x, a * self.y);
        Matrix3::new(
            1.0 - yy,
            xy,
            ay, //
            xy,
            1.0 - xx,
            -ax, //
            -ay,
            ax,
            1.0 - xx - yy,
        )
    }

    /// The end in the section's base frame: L (B y, −B x, A).
    pub(crate) fn end(&self) -> Vector3<f64> {
        let b = self.b();
        Vector3::new(b * self.y, -b * self.x, self.a()) * self.length
    }

    /// The tangent at the end, in the section's base frame: the third column of [`Self::rotation`].
    pub(crate) fn end_tangent(&self) -> Vector3<f64> {
        let (a, b) = (self.a(), self.b());
        let square = self.x * self.x + self.y * self.y;
        Vector3::new(a * self.y, -a * self.x, 1.0 - b * square)
    }

    /// The section's middle in its base frame, without another sine.
    pub(crate) fn middle(&self) -> Vector3<f64> {
        let b = 0.5 * self.half_sinc * self.half_sinc / (1.0 + self.half_cosine);
        Vector3::new(b * self.y, -b * self.x, self.half_sinc) * (0.5 * self.length)
    }

    /// Derivatives of [`Self::end`] with respect to x and y.
    pub(crate) fn end_derivatives(&self) -> [Vector3<f64>; 2] {
        let (b, (da, db)) = (self.b(), self.slopes());
        let (x2, y2) = (2.0 * self.x, 2.0 * self.y);
        let by_x = Vector3::new(x2 * db * self.y, -b - x2 * db * self.x, x2 * da);
        let by_y = Vector3::new(b + y2 * db * self.y, -y2 * db * self.x, y2 * da);
        [by_x * self.length, by_y * self.length]
    }

    /// Angular velocities of the end, in the section's base frame, for unit rates of x and y:
    /// the columns of the left Jacobian I + B ŵ + (1 − A)/θ² ŵ² of SO(3).
    pub(crate) fn angular_derivatives(&self) -> [Vector3<f64>; 2] {
        let (x, y, b, q) = (self.x, self.y, self.b(), self.one_minus_a_quotient());
        let by_x = Vector3::new(1.0 - q * y * y, q * x * y, -b * y);
        let by_y = Vector3::new(q * x * y, 1.0 - q * x * x, b * x);
        [by_x, by_y]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coefficients_are_those_of_the_model() {
        for angle in [1e-3_f64, 0.1, 0.7, 1.5, 3.0] {
            let arc = Arc::new(angle, 0.0, 1.0);
            assert!((arc.a() - angle.sin() / angle).abs() < 1e-15);
            assert!((arc.b() - (1.0 - angle.cos()) / (angle * angle)).abs() < 1e-10);
        }
        let straight = Arc::new(0.0, 0.0, 2.0);
        assert_eq!((straight.a(), straight.b()), (1.0, 0.5));
        assert_eq!(straight.end(), Vector3::new(0.0, 0.0, 2.0));
        assert_eq!(straight.rotation(), Matrix3::identity());
    }

    #[test]
    fn series_and_quotients_agree_where_they_meet() {
        let edge = SERIES_BELOW.sqrt();
        let [below, above] =
            [edge * (1.0 - 1e-13), edge * (1.0 + 1e-13)].map(|x| Arc::new(x, 0.0, 1.0));
        assert!(
            below.angle * below.angle < SERIES_BELOW && above.angle * above.angle >= SERIES_BELOW
        );
        assert!((below.slopes().0 - above.slopes().0).abs() < 1e-14);
        assert!((below.slopes().1 - above.slopes().1).abs() < 1e-14);
        assert!((below.one_minus_a_quotient() - above.one_minus_a_quotient()).abs() < 1e-14);
    }

    #[test]
    fn the_middle_is_the_end_of_the_first_half() {
        for (x, y) in [(0.0, 0.0), (1e-9, 0.0), (0.4, -0.9), (-2.0, 2.2)] {
            let arc = Arc::new(x, y, 1.3);
            assert!((arc.middle() - arc.part(0.5).end()).norm() < 1e-15);
        }
    }
}
