//! How much of the tendons' limits a motion uses: exact extremes of its polynomials, no sampling.
//!
//! Along a quintic segment a tendon's velocity is quartic, its acceleration cubic and its jerk quadratic in time.
//! Each extreme is at an end of the segment or at a root of the next derivative. All of them are kept as Bézier
//! (Bernstein) control values, whose largest magnitude bounds the polynomial: a segment that cannot raise the
//! result is skipped without looking for roots.

use crate::tendon::{
    LANES, Lanes, TendonBlock, TendonRows, combined, lanes, largest_lane, raise_to_magnitude,
};
use crate::{Knot, Trajectory};
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
}

/// The exact largest use of each limit by a motion.
///
/// A limit of 0 gives 0 where nothing moves and infinity otherwise.
pub fn limit_use(motion: &Trajectory, tendons: &TendonMap, limits: &TendonLimits) -> LimitUse {
    LimitUse::default().raised_by_motion(motion, &TendonRows::of(tendons), limits)
}

impl LimitUse {
    /// What a motion uses that fits its limits exactly once all its times are multiplied by `scale`.
    pub(crate) fn at_time_scale(scale: f64) -> Self {
        Self {
            velocity: scale,
            acceleration: scale * scale,
            jerk: scale * scale * scale,
        }
    }

    /// The larger of each ratio: these, and what a motion uses exactly. Segments that stay below them cost little.
    pub(crate) fn raised_by_motion(
        mut self,
        motion: &Trajectory,
        rows: &TendonRows,
        limits: &TendonLimits,
    ) -> Self {
        for segment in motion.segments() {
            let velocity = segment.velocity_control();
            for block in rows.blocks() {
                let control = ControlLanes::of(block, &velocity, segment.duration);
                self.raise(&control, limits);
            }
        }
        self
    }

    fn raise(&mut self, control: &ControlLanes, limits: &TendonLimits) {
        let ratio = |value: f64, limit: f64| if value == 0.0 { 0.0 } else { value / limit };
        let [velocity, acceleration, jerk] = control.bounds();
        if ratio(velocity, limits.velocity) > self.velocity {
            for lane in 0..LANES {
                let (v, a, j) = control.lane(lane);
                if ratio(largest_control(&v), limits.velocity) > self.velocity {
                    let most = ratio(extreme_of_quartic(&v, &a, &j), limits.velocity);
                    self.velocity = self.velocity.max(most);
                }
            }
        }
        if ratio(acceleration, limits.acceleration) > self.acceleration {
            for lane in 0..LANES {
                let (_, a, j) = control.lane(lane);
                if ratio(largest_control(&a), limits.acceleration) > self.acceleration {
                    let most = ratio(extreme_of_cubic(&a, &j), limits.acceleration);
                    self.acceleration = self.acceleration.max(most);
                }
            }
        }
        if ratio(jerk, limits.jerk) > self.jerk {
            for lane in 0..LANES {
                let (_, _, j) = control.lane(lane);
                let most = ratio(extreme_of_quadratic(&j), limits.jerk);
                self.jerk = self.jerk.max(most);
            }
        }
    }
}

/// Bernstein control values of the first three time derivatives of four tendons' lengths along a segment.
struct ControlLanes {
    velocity: [Lanes; 5],
    acceleration: [Lanes; 4],
    jerk: [Lanes; 3],
}

impl ControlLanes {
    #[inline(always)]
    fn of(block: &TendonBlock, velocity: &[Configuration; 5], duration: f64) -> Self {
        let mut control = [[0.0; LANES]; 5];
        for (lanes, value) in control.iter_mut().zip(velocity) {
            *lanes = block.times(value);
        }
        Self::from_velocity(control, duration)
    }

    #[inline(always)]
    fn from_velocity(velocity: [Lanes; 5], duration: f64) -> Self {
        let acceleration = differences_over(&velocity, duration / 4.0);
        let jerk = differences_over(&acceleration, duration / 3.0);
        Self {
            velocity,
            acceleration,
            jerk,
        }
    }

    /// Along the quintic between two knots (see [`crate::QuinticSegment::between`]).
    #[inline(always)]
    fn between(from: &TendonKnot, to: &TendonKnot, duration: f64) -> Self {
        let quarter = 0.25 * duration;
        let (first, last) = (from.velocity, to.velocity);
        let second = combined(&first, 1.0, &from.acceleration, quarter);
        let fourth = combined(&last, 1.0, &to.acceleration, -quarter);
        // The mean of the control values is the mean velocity.
        let five_means = 5.0 / duration;
        let third = lanes(|i| {
            let others = first[i] + second[i] + fourth[i] + last[i];
            (to.length[i] - from.length[i]) * five_means - others
        });
        Self::from_velocity([first, second, third, fourth, last], duration)
    }

    /// The largest magnitude of velocity and acceleration at the segment's ends and [`SAMPLES`] places between, and
    /// of jerk exactly.
    #[inline(always)]
    fn sampled(&self) -> [f64; 3] {
        let (mut velocity, mut acceleration, mut jerk) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
        for (quartic, cubic) in QUARTIC_WEIGHTS.iter().zip(&CUBIC_WEIGHTS) {
            raise_to_magnitude(&mut velocity, &weighted(&self.velocity, quartic));
            raise_to_magnitude(&mut acceleration, &weighted(&self.acceleration, cubic));
        }
        for end in [0, 1] {
            raise_to_magnitude(&mut velocity, &self.velocity[4 * end]);
            raise_to_magnitude(&mut acceleration, &self.acceleration[3 * end]);
            raise_to_magnitude(&mut jerk, &self.jerk[2 * end]);
        }
        raise_to_magnitude(&mut jerk, &turns_of_quadratics(&self.jerk));
        [velocity, acceleration, jerk].map(|lanes| largest_lane(&lanes))
    }

    /// The largest magnitude of a control value of each derivative.
    #[inline(always)]
    fn bounds(&self) -> [f64; 3] {
        [
            largest_of_lanes(&self.velocity),
            largest_of_lanes(&self.acceleration),
            largest_of_lanes(&self.jerk),
        ]
    }

    fn lane(&self, lane: usize) -> ([f64; 5], [f64; 4], [f64; 3]) {
        (
            self.velocity.map(|lanes| lanes[lane]),
            self.acceleration.map(|lanes| lanes[lane]),
            self.jerk.map(|lanes| lanes[lane]),
        )
    }
}

/// Places inside a segment at which [`sampled_time_scale`] looks.
const SAMPLES: usize = 7;
const QUARTIC_WEIGHTS: [[f64; 5]; SAMPLES] = bernstein_weights();
const CUBIC_WEIGHTS: [[f64; 4]; SAMPLES] = bernstein_weights();

/// The N Bernstein polynomials of degree N − 1 at evenly spaced places inside 0..1, by de Casteljau's triangle.
const fn bernstein_weights<const N: usize>() -> [[f64; N]; SAMPLES] {
    let mut all = [[0.0; N]; SAMPLES];
    let mut place = 0;
    while place < SAMPLES {
        let u = (place + 1) as f64 / (SAMPLES + 1) as f64;
        all[place][0] = 1.0;
        let mut degree = 1;
        while degree < N {
            let mut i = degree;
            while i > 0 {
                all[place][i] = (1.0 - u) * all[place][i] + u * all[place][i - 1];
                i -= 1;
            }
            all[place][0] *= 1.0 - u;
            degree += 1;
        }
        place += 1;
    }
    all
}

/// A knot in tendon space: four tendons' length, velocity and acceleration.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TendonKnot {
    length: Lanes,
    velocity: Lanes,
    acceleration: Lanes,
}

impl TendonKnot {
    #[inline(always)]
    pub(crate) fn of(block: &TendonBlock, knot: &Knot) -> Self {
        Self {
            length: block.times(&knot.position),
            velocity: block.times(&knot.velocity),
            acceleration: block.times(&knot.acceleration),
        }
    }
}

/// The factor by which all times of a segment must grow for it to keep the limits: a bound from below, by samples,
/// and one from above, by control values. Both are 0 where the segment is known to keep them.
#[inline(always)]
pub(crate) fn time_scale_bounds(
    from: &[TendonKnot],
    to: &[TendonKnot],
    duration: f64,
    limits: &TendonLimits,
) -> [f64; 2] {
    let mut least = [0.0; 3];
    let mut most = [0.0; 3];
    for (from, to) in from.iter().zip(to) {
        let control = ControlLanes::between(from, to, duration);
        let bounds = control.bounds();
        if bounds[0] > limits.velocity || bounds[1] > limits.acceleration || bounds[2] > limits.jerk
        {
            raise_each(&mut most, bounds);
            raise_each(&mut least, control.sampled());
        }
    }
    let scale = |values: [f64; 3]| {
        let used = LimitUse {
            velocity: values[0] / limits.velocity,
            acceleration: values[1] / limits.acceleration,
            jerk: values[2] / limits.jerk,
        };
        if used.largest() > 1.0 {
            used.time_scale()
        } else {
            0.0
        }
    };
    [scale(least), scale(most)]
}

/// The exact factor, if it is larger than `least`; else `least`.
pub(crate) fn exact_time_scale(
    from: &[TendonKnot],
    to: &[TendonKnot],
    duration: f64,
    limits: &TendonLimits,
    least: f64,
) -> f64 {
    let mut used = LimitUse::at_time_scale(least);
    for (from, to) in from.iter().zip(to) {
        used.raise(&ControlLanes::between(from, to, duration), limits);
    }
    used.time_scale().max(least)
}

#[inline(always)]
fn raise_each(most: &mut [f64; 3], values: [f64; 3]) {
    for (most, value) in most.iter_mut().zip(values) {
        *most = most.max(value);
    }
}

#[inline(always)]
fn weighted<const N: usize>(control: &[Lanes; N], weights: &[f64; N]) -> Lanes {
    let mut sum = [0.0; LANES];
    for (lanes, weight) in control.iter().zip(weights) {
        for lane in 0..LANES {
            sum[lane] += lanes[lane] * weight;
        }
    }
    sum
}

/// The values of quadratics where they turn, where that is inside 0..1; else at an end, or NaN.
#[inline(always)]
fn turns_of_quadratics(control: &[Lanes; 3]) -> Lanes {
    lanes(|lane| {
        let [first, middle, last] = [control[0][lane], control[1][lane], control[2][lane]];
        let u = ((first - middle) / (first - 2.0 * middle + last)).clamp(0.0, 1.0);
        let (left, right) = (first + u * (middle - first), middle + u * (last - middle));
        left + u * (right - left)
    })
}

#[inline(always)]
fn differences_over<const N: usize, const M: usize>(control: &[Lanes; N], part: f64) -> [Lanes; M] {
    let scale = 1.0 / part;
    let mut differences = [[0.0; LANES]; M];
    for (i, difference) in differences.iter_mut().enumerate() {
        *difference = lanes(|lane| (control[i + 1][lane] - control[i][lane]) * scale);
    }
    differences
}

#[inline(always)]
fn largest_of_lanes(control: &[Lanes]) -> f64 {
    let mut most = [0.0; LANES];
    for lanes in control {
        raise_to_magnitude(&mut most, lanes);
    }
    largest_lane(&most)
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

/// The root between `low` and `high` of a cubic that is monotone there, by Newton's method within a bracket.
fn monotone_root(control: &[f64; 4], mut low: f64, mut high: f64) -> Option<f64> {
    // At an extreme the error of the value is quadratic in the error of the root: this is far more than enough.
    const PRECISION: f64 = 1e-12;
    let rises = value_at(control, high) > 0.0;
    if low >= high || (value_at(control, low) > 0.0) == rises {
        return None;
    }
    let mut root = 0.5 * (low + high);
    for _ in 0..60 {
        let (value, slope) = value_and_slope(control, root);
        *(if (value > 0.0) == rises {
            &mut high
        } else {
            &mut low
        }) = root;
        let step = value / slope;
        let next = root - step;
        let is_inside = next > low && next < high;
        root = if is_inside { next } else { 0.5 * (low + high) };
        if high - low < PRECISION || (is_inside && step.abs() < PRECISION) {
            break;
        }
    }
    Some(root)
}

/// Value and derivative at `u` of the cubic with these control values.
fn value_and_slope(control: &[f64; 4], u: f64) -> (f64, f64) {
    let between = |a: f64, b: f64| a + u * (b - a);
    let [a, b, c, d] = *control;
    let (ab, bc, cd) = (between(a, b), between(b, c), between(c, d));
    let (first, second) = (between(ab, bc), between(bc, cd));
    (between(first, second), 3.0 * (second - first))
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
