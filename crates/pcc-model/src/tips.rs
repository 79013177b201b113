//! Tips of configurations and how they move, four at a time (decision 0019).
//!
//! A tip is built from the last section to the first: p₁ + R₁ (p₂ + R₂ p₃), with p and R of docs/robot.md "Conventions". So is its
//! Jacobian: the two columns of section i are R₁ … Rᵢ₋₁ ∂(pᵢ + Rᵢ v)/∂ξᵢ, v the tip as the end of that section sees it.

use crate::lanes::{LANES, dot, one_by_one, side_by_side};
use crate::section::half_sincs_cosines_and_slopes;
use crate::{Configuration, DOF, Point, SECTIONS};
use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch, f64x4};

/// The tips of four configurations, and how they move with them.
#[derive(Clone, Copy, Debug)]
pub struct MovingTips<S: Simd> {
    /// Positions, base frame, `[axis]`, length unit.
    pub positions: [f64x4<S>; 3],
    /// Jacobians ∂tip/∂ζ, base frame, `[column][axis]`, length unit per radian.
    pub jacobians: [[f64x4<S>; 3]; DOF],
}

impl<S: Simd> MovingTips<S> {
    /// The tips of four configurations (`[row][lane]`, radians) of a robot with these section lengths.
    #[inline(always)]
    pub(crate) fn of(lengths: &[f64; SECTIONS], configurations: &[f64x4<S>; DOF]) -> Self {
        let [x1, y1, x2, y2, x3, y3] = *configurations;
        let first = Bends::new(lengths[0], x1, y1);
        let second = Bends::new(lengths[1], x2, y2);
        let third = Bends::new(lengths[2], x3, y3);
        let nothing = third.a * 0.0;
        let seen_from_second = third.end();
        let seen_from_first = second.carry(&seen_from_second);
        let (turn_first, turn_second) = (first.rotation(), second.rotation());
        let [by_x1, by_y1] = first.rates(&seen_from_first);
        let [by_x2, by_y2] = second.rates(&seen_from_second);
        let [by_x3, by_y3] = third.rates(&[nothing; 3]);
        Self {
            positions: first.carry(&seen_from_first),
            jacobians: [
                by_x1,
                by_y1,
                turned(&turn_first, &by_x2),
                turned(&turn_first, &by_y2),
                turned(&turn_first, &turned(&turn_second, &by_x3)),
                turned(&turn_first, &turned(&turn_second, &by_y3)),
            ],
        }
    }
}

/// Positions of the tips of `configurations` (rad) of a robot with these section lengths, base frame.
pub(crate) fn tips_of(lengths: &[f64; SECTIONS], configurations: &[Configuration]) -> Vec<Point> {
    dispatch!(Level::new(), simd => tips_at(simd, lengths, configurations))
}

#[inline(always)]
fn tips_at<S: Simd>(
    simd: S,
    lengths: &[f64; SECTIONS],
    configurations: &[Configuration],
) -> Vec<Point> {
    let mut tips = Vec::with_capacity(configurations.len());
    for some in configurations.chunks(LANES) {
        let mut four = [some[0]; LANES];
        four[..some.len()].copy_from_slice(some);
        let components = side_by_side(simd, &four);
        let mut seen = [f64x4::splat(simd, 0.0); 3];
        for section in (0..SECTIONS).rev() {
            let (x, y) = (components[2 * section], components[2 * section + 1]);
            seen = Bends::new(lengths[section], x, y).carry(&seen);
        }
        tips.extend_from_slice(&one_by_one(&seen)[..some.len()]);
    }
    tips
}

/// One section in four configurations, (x, y) its bending pairs.
struct Bends<S: Simd> {
    length: f64,
    x: f64x4<S>,
    y: f64x4<S>,
    a: f64x4<S>,
    b: f64x4<S>,
    /// 2 dA/ds and 2 dB/ds at s = θ².
    slopes: [f64x4<S>; 2],
}

impl<S: Simd> Bends<S> {
    #[inline(always)]
    fn new(length: f64, x: f64x4<S>, y: f64x4<S>) -> Self {
        let [sinc, cosine, slope] = half_sincs_cosines_and_slopes((x * x + y * y) * 0.25);
        let square = sinc * sinc;
        Self {
            length,
            x,
            y,
            a: sinc * cosine,
            b: square * 0.5,
            slopes: [(slope * cosine - square * 0.125) * 2.0, sinc * slope * 2.0],
        }
    }

    /// p, the end of the section in its base frame.
    #[inline(always)]
    fn end(&self) -> [f64x4<S>; 3] {
        let b = self.b * self.length;
        [b * self.y, -(b * self.x), self.a * self.length]
    }

    /// p + R v: a point given in the frame of the section's end, in its base frame.
    #[inline(always)]
    fn carry(&self, v: &[f64x4<S>; 3]) -> [f64x4<S>; 3] {
        let (x, y, a, b) = (self.x, self.y, self.a, self.b);
        let [tx, ty, tz] = self.turning(v);
        let along = tz + self.length;
        [
            v[0] + a * tx + b * (y * along),
            v[1] + a * ty - b * (x * along),
            v[2] + a * along + b * (x * ty - y * tx),
        ]
    }

    /// w × v with w = (x, y, 0).
    #[inline(always)]
    fn turning(&self, v: &[f64x4<S>; 3]) -> [f64x4<S>; 3] {
        let (x, y) = (self.x, self.y);
        [y * v[2], -(x * v[2]), x * v[1] - y * v[0]]
    }

    /// ∂(p + R v)/∂x and ∂(p + R v)/∂y.
    #[inline(always)]
    fn rates(&self, v: &[f64x4<S>; 3]) -> [[f64x4<S>; 3]; 2] {
        let (x, y, a, b, length) = (self.x, self.y, self.a, self.b, self.length);
        let [vx, vy, vz] = *v;
        let [tx, ty, tz] = self.turning(v);
        // What the slopes of A and B multiply: ŵ v + L z, ŵ² v + L (y, −x, 0).
        let along = tz + length;
        let [ux, uy, uz] = [y * along, -(x * along), x * ty - y * tx];
        let [slope_a, slope_b] = self.slopes;
        let (ax, bx, ay, by) = (slope_a * x, slope_b * x, slope_a * y, slope_b * y);
        [
            [
                ax * tx + bx * ux + b * (y * vy),
                ax * ty + bx * uy - a * vz - b * (along + x * vy),
                ax * along + bx * uz + a * vy - b * (x * vz) * 2.0,
            ],
            [
                ay * tx + by * ux + a * vz + b * (along - y * vx),
                ay * ty + by * uy + b * (x * vx),
                ay * along + by * uz - a * vx - b * (y * vz) * 2.0,
            ],
        ]
    }

    /// The rows of R, the rotation from the section's base to its end.
    #[inline(always)]
    fn rotation(&self) -> [[f64x4<S>; 3]; 3] {
        let (x, y) = (self.x, self.y);
        let (ax, ay, bx, by) = (self.a * x, self.a * y, self.b * x, self.b * y);
        let (xx, xy, yy) = (bx * x, bx * y, by * y);
        [
            [-yy + 1.0, xy, ay],
            [xy, -xx + 1.0, -ax],
            [-ay, ax, -(xx + yy) + 1.0],
        ]
    }
}

/// The product R v, `rotation` row by row.
#[inline(always)]
fn turned<S: Simd>(rotation: &[[f64x4<S>; 3]; 3], v: &[f64x4<S>; 3]) -> [f64x4<S>; 3] {
    let [first, second, third] = rotation;
    [dot(first, v), dot(second, v), dot(third, v)]
}
