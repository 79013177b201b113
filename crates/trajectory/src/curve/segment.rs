//! One quintic piece of a motion, in Bézier form.

use crate::{Knot, State};
use pcc_model::Configuration;

/// The quintic that joins two knots, as the six Bézier control points of its position.
///
/// The curve lies in the convex hull of the control points, and the same holds for the control values of the
/// derivatives: certificates bound motion with them (Farin, "Curves and Surfaces for CAGD", chapters 4 and 5).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QuinticSegment {
    /// Length of the segment, s.
    pub duration: f64,
    /// Bézier control points of the position, rad.
    pub control: [Configuration; 6],
}

impl QuinticSegment {
    /// The segment that has the position, velocity and acceleration of both knots (quintic Hermite).
    pub fn between(from: &Knot, to: &Knot) -> Self {
        let duration = to.time - from.time;
        let (p0, p1) = (from.position, to.position);
        let (v0, v1) = (
            from.velocity * (duration / 5.0),
            to.velocity * (duration / 5.0),
        );
        let curve = duration * duration / 20.0;
        let (a0, a1) = (from.acceleration * curve, to.acceleration * curve);
        Self {
            duration,
            control: [
                p0,
                p0 + v0,
                p0 + v0 * 2.0 + a0,
                p1 - v1 * 2.0 + a1,
                p1 - v1,
                p1,
            ],
        }
    }

    /// The state `time` seconds after the segment's start; `time` is clamped to the segment.
    pub fn evaluate(&self, time: f64) -> State {
        let u = (time / self.duration).clamp(0.0, 1.0);
        let velocity = self.velocity_control();
        let acceleration = self.acceleration_control();
        let jerk = self.jerk_control();
        State {
            position: blend(&self.control, &bernstein::<6>(u)),
            velocity: blend(&velocity, &bernstein::<5>(u)),
            acceleration: blend(&acceleration, &bernstein::<4>(u)),
            jerk: blend(&jerk, &bernstein::<3>(u)),
        }
    }

    /// The position half-way in time, rad.
    pub(crate) fn middle(&self) -> Configuration {
        let [a, b, c, d, e, f] = &self.control;
        ((c + d) * 10.0 + (b + e) * 5.0 + (a + f)) / 32.0
    }

    /// The position, rad, `time` seconds after the segment's start; `time` is clamped to the segment.
    pub fn position(&self, time: f64) -> Configuration {
        let u = (time / self.duration).clamp(0.0, 1.0);
        let (v, uu) = (1.0 - u, u * u);
        let vv = v * v;
        let weights = [
            vv * vv * v,
            5.0 * vv * vv * u,
            10.0 * vv * v * uu,
            10.0 * vv * uu * u,
            5.0 * v * uu * uu,
            uu * uu * u,
        ];
        blend(&self.control, &weights)
    }

    /// The first and the second half of the segment (de Casteljau), each of half the duration.
    #[must_use]
    pub fn halves(&self) -> (Self, Self) {
        let mut points = self.control;
        let (mut first, mut second) = (points, points);
        for level in 1..points.len() {
            for i in 0..points.len() - level {
                points[i] = (points[i] + points[i + 1]) * 0.5;
            }
            first[level] = points[0];
            second[5 - level] = points[5 - level];
        }
        let duration = 0.5 * self.duration;
        let half = |control| Self { duration, control };
        (half(first), half(second))
    }

    /// Bézier control values of dζ/dt, rad/s: the velocity stays in their convex hull.
    pub(crate) fn velocity_control(&self) -> [Configuration; 5] {
        let scale = 5.0 / self.duration;
        std::array::from_fn(|i| (self.control[i + 1] - self.control[i]) * scale)
    }

    /// Bézier control values of d²ζ/dt², rad/s²: the acceleration stays in their convex hull.
    fn acceleration_control(&self) -> [Configuration; 4] {
        let scale = 4.0 / self.duration;
        let velocity = self.velocity_control();
        std::array::from_fn(|i| (velocity[i + 1] - velocity[i]) * scale)
    }

    /// Bézier control values of d³ζ/dt³, rad/s³: the jerk stays in their convex hull.
    fn jerk_control(&self) -> [Configuration; 3] {
        let scale = 3.0 / self.duration;
        let acceleration = self.acceleration_control();
        std::array::from_fn(|i| (acceleration[i + 1] - acceleration[i]) * scale)
    }
}

fn blend<const N: usize>(control: &[Configuration; N], weights: &[f64; N]) -> Configuration {
    control
        .iter()
        .zip(weights)
        .fold(Configuration::zeros(), |sum, (point, &weight)| {
            sum + point * weight
        })
}

/// The N Bernstein polynomials of degree N − 1 at `u`, by de Casteljau's triangle.
fn bernstein<const N: usize>(u: f64) -> [f64; N] {
    let mut weights = [0.0; N];
    weights[0] = 1.0;
    for degree in 1..N {
        let mut carried = 0.0;
        for weight in &mut weights[..=degree] {
            let next = carried + (1.0 - u) * *weight;
            carried = u * *weight;
            *weight = next;
        }
    }
    weights
}

#[cfg(test)]
mod tests {
    use super::*;

    fn knots() -> [Knot; 2] {
        let vector = |seed: f64| Configuration::from_fn(|row, _| (seed + 1.7 * row as f64).sin());
        [(0.3, 0.0), (0.8, 5.0)].map(|(time, seed)| Knot {
            time,
            position: vector(seed),
            velocity: vector(seed + 1.0),
            acceleration: vector(seed + 2.0),
        })
    }

    #[test]
    fn both_ends_are_met() {
        let [from, to] = knots();
        let segment = QuinticSegment::between(&from, &to);
        for (time, knot) in [(0.0, from), (segment.duration, to)] {
            let state = segment.evaluate(time);
            assert_eq!(state.position, knot.position);
            assert!((state.velocity - knot.velocity).amax() < 1e-13);
            assert!((state.acceleration - knot.acceleration).amax() < 1e-11);
        }
    }

    #[test]
    fn derivatives_agree_with_differences() {
        let [from, to] = knots();
        let segment = QuinticSegment::between(&from, &to);
        let step = 1e-4;
        for i in 1..50 {
            let time = 0.01 * f64::from(i);
            let [before, here, after] = [-step, 0.0, step].map(|d| segment.evaluate(time + d));
            let slope = |a: Configuration, b: Configuration| (b - a) / (2.0 * step);
            assert!((slope(before.position, after.position) - here.velocity).amax() < 1e-4);
            assert!((slope(before.velocity, after.velocity) - here.acceleration).amax() < 1e-3);
            assert!((slope(before.acceleration, after.acceleration) - here.jerk).amax() < 1e-1);
        }
    }

    #[test]
    fn weights_are_a_partition_of_one() {
        for u in [0.0, 0.2, 0.5, 1.0] {
            let weights = bernstein::<6>(u);
            assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-15);
            assert!((weights[2] - 10.0 * u * u * (1.0 - u).powi(3)).abs() < 1e-15);
        }
    }
}
