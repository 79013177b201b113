//! How much of the tendons' limits a motion uses: exact extremes of its polynomials, no sampling.
//!
//! Along a quintic segment a tendon's velocity is quartic, its acceleration cubic and its jerk quadratic in time.
//! Each extreme is at an end of the segment or at a root of the next derivative. All of them are kept as Bézier
//! (Bernstein) control values, whose largest magnitude bounds the polynomial: a segment that cannot raise the
//! result is skipped without looking for roots.

use crate::tendon::TendonRows;
use crate::{QuinticSegment, Trajectory};
use pcc_model::{Configuration, TendonLimits, TendonMap};

/// Largest |value| ÷ limit over all tendons and the whole motion, one ratio for each derivative of tendon length.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LimitUse {
    /// Tendon velocity ÷ its limit.
    pub velocity: f64,
    /// Tendon acceleration ÷ its limit.
    pub acceleration: f64,
    /// Tendon jerk ÷ its limit.
    pub jerk: f64,
}

impl LimitUse {
    /// The largest of the three ratios; the motion keeps its limits if it is at most 1.
    pub fn largest(&self) -> f64 {
        self.velocity.max(self.acceleration).max(self.jerk)
    }

    /// The factor by which all times must grow to bring every ratio to at most 1: a velocity falls with the
    /// factor, an acceleration with its square, a jerk with its cube. Below 1 there is room to go faster.
    pub fn time_scale(&self) -> f64 {
        self.velocity
            .max(self.acceleration.sqrt())
            .max(self.jerk.cbrt())
    }

    /// The larger of each ratio.
    pub(crate) fn raised_by(&self, other: &Self) -> Self {
        Self {
            velocity: self.velocity.max(other.velocity),
            acceleration: self.acceleration.max(other.acceleration),
            jerk: self.jerk.max(other.jerk),
        }
    }
}

/// The exact largest use of each limit by a motion.
///
/// A limit of 0 gives 0 where nothing moves and infinity otherwise.
pub fn limit_use(motion: &Trajectory, tendons: &TendonMap, limits: &TendonLimits) -> LimitUse {
    let rows = TendonRows::of(tendons);
    let mut most = LimitUse::default();
    for segment in motion.segments() {
        raise_by_segment(&mut most, &segment, &rows, limits);
    }
    most
}

/// The exact use of each limit by one segment.
pub(crate) fn segment_use(
    segment: &QuinticSegment,
    rows: &TendonRows,
    limits: &TendonLimits,
) -> LimitUse {
    let mut most = LimitUse::default();
    raise_by_segment(&mut most, segment, rows, limits);
    most
}

fn raise_by_segment(
    most: &mut LimitUse,
    segment: &QuinticSegment,
    rows: &TendonRows,
    limits: &TendonLimits,
) {
    let velocity = segment.velocity_control();
    let scale = 4.0 / segment.duration;
    let jerk_scale = 3.0 / segment.duration;
    let ratio = |value: f64, limit: f64| if value == 0.0 { 0.0 } else { value / limit };
    for row in rows.iter() {
        let v = project(row, &velocity);
        let a: [f64; 4] = std::array::from_fn(|i| (v[i + 1] - v[i]) * scale);
        let j: [f64; 3] = std::array::from_fn(|i| (a[i + 1] - a[i]) * jerk_scale);
        let mut here = LimitUse::default();
        if ratio(largest_control(&v), limits.velocity) > most.velocity {
            here.velocity = ratio(extreme_of_quartic(&v, &a, &j), limits.velocity);
        }
        if ratio(largest_control(&a), limits.acceleration) > most.acceleration {
            here.acceleration = ratio(extreme_of_cubic(&a, &j), limits.acceleration);
        }
        if ratio(largest_control(&j), limits.jerk) > most.jerk {
            here.jerk = ratio(extreme_of_quadratic(&j), limits.jerk);
        }
        *most = most.raised_by(&here);
    }
}

fn project(row: &Configuration, control: &[Configuration; 5]) -> [f64; 5] {
    std::array::from_fn(|i| row.dot(&control[i]))
}

fn largest_control(control: &[f64]) -> f64 {
    control
        .iter()
        .fold(0.0, |most: f64, value| most.max(value.abs()))
}

/// Value at `u` in 0..1 of the polynomial with these Bernstein control values (de Casteljau).
fn value_at<const N: usize>(control: &[f64; N], u: f64) -> f64 {
    let mut points = *control;
    for level in (1..N).rev() {
        for i in 0..level {
            points[i] += u * (points[i + 1] - points[i]);
        }
    }
    points[0]
}

/// The largest |value| of a quadratic over 0..1.
fn extreme_of_quadratic(control: &[f64; 3]) -> f64 {
    let [first, middle, last] = *control;
    let ends = first.abs().max(last.abs());
    let turn = (first - middle) / (first - 2.0 * middle + last);
    if turn > 0.0 && turn < 1.0 {
        ends.max(value_at(control, turn).abs())
    } else {
        ends
    }
}

/// The largest |value| of a cubic over 0..1; `slope`: control values proportional to its derivative.
fn extreme_of_cubic(control: &[f64; 4], slope: &[f64; 3]) -> f64 {
    let ends = control[0].abs().max(control[3].abs());
    quadratic_roots(slope)
        .into_iter()
        .fold(ends, |most, u| most.max(value_at(control, u).abs()))
}

/// The largest |value| of a quartic over 0..1; `slope` and `bend`: proportional to its two derivatives.
///
/// The roots of `bend` cut 0..1 into at most three intervals on which `slope` is monotone, so each has at most
/// one root of it, bracketed by a change of sign.
fn extreme_of_quartic(control: &[f64; 5], slope: &[f64; 4], bend: &[f64; 3]) -> f64 {
    let mut most = control[0].abs().max(control[4].abs());
    let [first, second] = quadratic_roots(bend);
    let cuts = [0.0, first.min(second), first.max(second), 1.0];
    for pair in cuts.windows(2) {
        if let Some(root) = monotone_root(slope, pair[0], pair[1]) {
            most = most.max(value_at(control, root).abs());
        }
    }
    most
}

/// The roots in 0..1 of a quadratic; 0 stands for a root that does not exist or is outside.
fn quadratic_roots(control: &[f64; 3]) -> [f64; 2] {
    let [c, half, last] = *control;
    let half_b = half - c;
    let a = c - 2.0 * half + last;
    let discriminant = half_b * half_b - a * c;
    if discriminant < 0.0 {
        return [0.0; 2];
    }
    // The form without cancellation: q has the sign of −b, the roots are q/a and c/q.
    let q = -(half_b + discriminant.sqrt().copysign(half_b));
    [q / a, c / q].map(|root| if root > 0.0 && root < 1.0 { root } else { 0.0 })
}

/// The root between `low` and `high` of a cubic that is monotone there, by bisection.
fn monotone_root(control: &[f64; 4], mut low: f64, mut high: f64) -> Option<f64> {
    let rises = value_at(control, high) > 0.0;
    if low >= high || (value_at(control, low) > 0.0) == rises {
        return None;
    }
    // At an extreme the error of the value is quadratic in the error of the root: 2^-40 is far more than enough.
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if (value_at(control, middle) > 0.0) == rises {
            high = middle;
        } else {
            low = middle;
        }
    }
    Some(0.5 * (low + high))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    fn sampled<const N: usize>(control: &[f64; N]) -> f64 {
        (0..=4000)
            .map(|i| value_at(control, f64::from(i) / 4000.0).abs())
            .fold(0.0, f64::max)
    }

    fn differences<const N: usize, const M: usize>(control: &[f64; N]) -> [f64; M] {
        std::array::from_fn(|i| control[i + 1] - control[i])
    }

    #[test]
    fn extremes_agree_with_dense_samples() {
        let mut random = rand_pcg::Pcg64::seed_from_u64(11);
        let mut inside = 0;
        for _ in 0..3000 {
            let quartic: [f64; 5] = std::array::from_fn(|_| random.random_range(-1.0..1.0));
            let cubic: [f64; 4] = differences(&quartic);
            let quadratic: [f64; 3] = differences(&cubic);
            let exact = [
                extreme_of_quartic(&quartic, &cubic, &quadratic),
                extreme_of_cubic(&cubic, &quadratic),
                extreme_of_quadratic(&quadratic),
            ];
            let dense = [sampled(&quartic), sampled(&cubic), sampled(&quadratic)];
            for (exact, dense) in exact.into_iter().zip(dense) {
                assert!(
                    exact >= dense - 1e-14 && exact - dense < 1e-6,
                    "{exact} against {dense}"
                );
            }
            inside += usize::from(exact[0] > quartic[0].abs().max(quartic[4].abs()));
        }
        assert!(
            inside > 500,
            "only {inside} extremes were inside the interval"
        );
    }

    #[test]
    fn flat_and_degenerate_polynomials_are_exact() {
        assert_eq!(extreme_of_quartic(&[2.0; 5], &[0.0; 4], &[0.0; 3]), 2.0);
        assert_eq!(extreme_of_cubic(&[0.0, 1.0, 2.0, 3.0], &[1.0; 3]), 3.0);
        assert_eq!(extreme_of_quadratic(&[-1.0, 0.0, 1.0]), 1.0);
        // (u − ½)³ as slope: a triple root, where the second derivative has a double one.
        let slope = [-0.125, 0.125, -0.125, 0.125];
        let quartic = [0.0, -0.125, 0.0, -0.125, 0.0];
        let most = extreme_of_quartic(&quartic, &slope, &differences(&slope));
        assert!((most - 0.0625).abs() < 1e-12, "{most}");
    }

    #[test]
    fn time_scale_brings_every_ratio_to_one() {
        let most = LimitUse {
            velocity: 1.5,
            acceleration: 4.0,
            jerk: 1.0,
        };
        assert_eq!(most.time_scale(), 2.0);
        assert_eq!(most.largest(), 4.0);
    }
}
