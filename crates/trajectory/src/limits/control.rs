//! Bernstein control values of tendons along quintic segments, four tendons at a time: bounds and samples.

use crate::Knot;
use crate::limits::tendon_rows::{
    LANES, Lanes, TendonBlock, combined, lanes, largest_lane, raise_to_magnitude,
};
use pcc_model::Configuration;

/// Bernstein control values of the first three time derivatives of four tendons' lengths along a segment.
pub(super) struct ControlLanes {
    velocity: [Lanes; 5],
    acceleration: [Lanes; 4],
    jerk: [Lanes; 3],
}

impl ControlLanes {
    #[inline(always)]
    pub(super) fn of(block: &TendonBlock, velocity: &[Configuration; 5], duration: f64) -> Self {
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

    /// Control values along the quintic between two knots (see [`crate::QuinticSegment::between`]), `duration` seconds long.
    #[inline(always)]
    pub(super) fn between(from: &TendonKnot, to: &TendonKnot, duration: f64) -> Self {
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

    /// The largest magnitudes of velocity, acceleration and jerk, each of those `wanted`, else 0: velocity and acceleration at the
    /// segment's ends and [`SAMPLES`] places between, jerk exactly.
    #[inline(always)]
    pub(super) fn sampled(&self, wanted: [bool; 3]) -> [f64; 3] {
        let mut largest = [0.0; 3];
        if wanted[0] {
            largest[0] = largest_sample(&self.velocity, &QUARTIC_WEIGHTS);
        }
        if wanted[1] {
            largest[1] = largest_sample(&self.acceleration, &CUBIC_WEIGHTS);
        }
        if wanted[2] {
            largest[2] = self.largest_jerk();
        }
        largest
    }

    #[inline(always)]
    fn largest_jerk(&self) -> f64 {
        let mut most = [0.0; LANES];
        raise_to_magnitude(&mut most, &turns_of_quadratics(&self.jerk));
        raise_to_magnitude(&mut most, &self.jerk[0]);
        raise_to_magnitude(&mut most, &self.jerk[2]);
        largest_lane(&most)
    }

    /// Upper bounds of the magnitudes of velocity, acceleration and jerk: their largest control values.
    #[inline(always)]
    pub(super) fn bounds(&self) -> [f64; 3] {
        [
            largest_of_lanes(&self.velocity),
            largest_of_lanes(&self.acceleration),
            largest_of_lanes(&self.jerk),
        ]
    }

    /// Control values of velocity, acceleration and jerk of one of the four tendons.
    pub(super) fn lane(&self, lane: usize) -> ([f64; 5], [f64; 4], [f64; 3]) {
        (
            self.velocity.map(|lanes| lanes[lane]),
            self.acceleration.map(|lanes| lanes[lane]),
            self.jerk.map(|lanes| lanes[lane]),
        )
    }
}

/// Places inside a segment at which derivatives are sampled.
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

/// The largest magnitude of polynomials with these control values, at the ends of 0..1 and at the places that the weights are for.
#[inline(always)]
fn largest_sample<const N: usize>(control: &[Lanes; N], weights: &[[f64; N]; SAMPLES]) -> f64 {
    let mut most = [0.0; LANES];
    for weights in weights {
        raise_to_magnitude(&mut most, &weighted(control, weights));
    }
    raise_to_magnitude(&mut most, &control[0]);
    raise_to_magnitude(&mut most, &control[N - 1]);
    largest_lane(&most)
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

/// The values of quadratics at their extreme if that is inside 0..1, else at an end of 0..1, or NaN.
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
