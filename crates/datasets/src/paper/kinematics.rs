//! Tip kinematics written so that a loop over many configurations becomes vector instructions.
//!
//! Everything about a section of bending angle θ, s = θ², follows from two power series without any division:
//! q = (1 − A)/s and r = (1/2 − B)/s, so that A = 1 − s q, B = 1/2 − s r, dA/ds = (q − B)/2, dB/ds = r − q/2.
//! There are no branches and no calls but inlined ones, and no fused operation: the result does not depend on the
//! processor.

use pcc_model::{DOF, SECTIONS};

/// λ of the damped pseudo-inverse Jᵀ(JJᵀ + λI)⁻¹ (docs/evaluation.md "The reference setting").
pub(super) const DAMPING: f64 = 1e-4;
/// Terms of the two series: the next one is below 1e-16 up to a bending angle of π.
const TERMS: usize = 13;

/// Shapes looked at together where work may be left out.
const CHUNK: usize = 8;

/// Three components.
pub(super) type Vector = [f64; 3];
/// Rows of a rotation.
pub(super) type Rotation = [Vector; 3];
/// A configuration, radians.
pub(super) type Shape = [f64; DOF];

/// A section, or the part of it from its base.
#[derive(Clone, Copy)]
pub(super) struct Arc {
    x: f64,
    y: f64,
    length: f64,
    a: f64,
    b: f64,
    q: f64,
    r: f64,
    cosine: f64,
}

/// 1/(2k+3)! and 1/(2k+4)! with alternating signs.
const SERIES: [[f64; 2]; TERMS] = {
    let mut series = [[0.0; 2]; TERMS];
    let (mut k, mut factorial, mut sign) = (0, 2.0, 1.0);
    while k < TERMS {
        factorial *= (2 * k + 3) as f64;
        series[k][0] = sign / factorial;
        factorial *= (2 * k + 4) as f64;
        series[k][1] = sign / factorial;
        sign = -sign;
        k += 1;
    }
    series
};

impl Arc {
    #[inline(always)]
    pub(super) fn new(x: f64, y: f64, length: f64) -> Self {
        let s = x * x + y * y;
        let [mut q, mut r] = SERIES[TERMS - 1];
        for [q_term, r_term] in SERIES[..TERMS - 1].iter().rev() {
            q = q * s + q_term;
            r = r * s + r_term;
        }
        let b = 0.5 - s * r;
        Self {
            x,
            y,
            length,
            a: 1.0 - s * q,
            b,
            q,
            r,
            cosine: 1.0 - s * b,
        }
    }

    /// The end in the section's base frame: L (B y, −B x, A).
    #[inline(always)]
    pub(super) fn end(&self) -> Vector {
        let b = self.b * self.length;
        [b * self.y, -(b * self.x), self.a * self.length]
    }

    /// Derivatives of [`Self::end`] with respect to x and y.
    #[inline(always)]
    fn end_derivatives(&self) -> [Vector; 2] {
        let (x, y, b) = (self.x, self.y, self.b * self.length);
        let a_slope = (self.q - self.b) * self.length;
        let b_slope = (self.r + self.r - self.q) * self.length;
        let (bx, by) = (b_slope * x, b_slope * y);
        let cross = bx * y;
        [
            [cross, -b - bx * x, a_slope * x],
            [b + by * y, -cross, a_slope * y],
        ]
    }

    /// Angular velocities of the end for unit rates of x and y, in the base frame (`side` 1) or the end frame (−1).
    #[inline(always)]
    fn angular_derivatives(&self, side: f64) -> [Vector; 2] {
        let (x, y) = (self.x, self.y);
        let (qx, qy, b) = (self.q * x, self.q * y, self.b * side);
        let cross = qx * y;
        [
            [1.0 - qy * y, cross, -(b * y)],
            [cross, 1.0 - qx * x, b * x],
        ]
    }

    /// Rows of the rotation from the base to the end.
    #[inline(always)]
    pub(super) fn rotation(&self) -> Rotation {
        let (x, y) = (self.x, self.y);
        let (ax, ay, bx, by) = (self.a * x, self.a * y, self.b * x, self.b * y);
        let cross = bx * y;
        [
            [1.0 - by * y, cross, ay],
            [cross, 1.0 - bx * x, -ax],
            [-ay, ax, self.cosine],
        ]
    }
}

/// What one look at a tip finds out.
pub(super) struct TipStep {
    /// Squared distance of the tip to its point.
    pub(super) squared_distance: f64,
    /// The shape after one damped step towards the point; it may be outside the bending limit.
    pub(super) next: Shape,
}

/// Looks at the tip of a shape and makes the damped step J⁺(e − J w) + w towards `point` with the wish w.
#[inline(always)]
pub(super) fn tip_step(
    lengths: &[f64; SECTIONS],
    shape: &Shape,
    point: &Vector,
    wish: &Shape,
) -> TipStep {
    let (error, jacobian) = tip_in_first_frame(lengths, shape, point);
    let mut left = error;
    for axis in 0..3 {
        let mut wished = jacobian[0][axis] * wish[0];
        for d in 1..DOF {
            wished += jacobian[d][axis] * wish[d];
        }
        left[axis] -= wished;
    }
    let pull = solve_damped(&jacobian, &left);
    let mut next = *shape;
    for d in 0..DOF {
        next[d] += wish[d] + dot(&jacobian[d], &pull);
    }
    TipStep {
        squared_distance: dot(&error, &error),
        next,
    }
}

/// Tip error and columns of the tip Jacobian, both seen in the frame at the end of the first section.
///
/// The damped step does not depend on the frame, and in this one fewest vectors have to be turned.
#[inline(always)]
fn tip_in_first_frame(
    lengths: &[f64; SECTIONS],
    shape: &Shape,
    point: &Vector,
) -> (Vector, [Vector; DOF]) {
    let first = Arc::new(shape[0], shape[1], lengths[0]);
    let second = Arc::new(shape[2], shape[3], lengths[1]);
    let third = Arc::new(shape[4], shape[5], lengths[2]);
    let turn = second.rotation();
    let third_in_first = rotate(&turn, &third.end());
    let beyond = add(&second.end(), &third_in_first);
    let [third_x, third_y] = third.end_derivatives();
    let [x, y] = second.end_derivatives();
    let [turn_x, turn_y] = second.angular_derivatives(1.0);
    let second_x = add(&x, &cross(&turn_x, &third_in_first));
    let second_y = add(&y, &cross(&turn_y, &third_in_first));
    let (third_x, third_y) = (rotate(&turn, &third_x), rotate(&turn, &third_y));
    let turn = first.rotation();
    let [x, y] = first.end_derivatives();
    let [turn_x, turn_y] = first.angular_derivatives(-1.0);
    let first_x = add(&rotate_back(&turn, &x), &cross(&turn_x, &beyond));
    let first_y = add(&rotate_back(&turn, &y), &cross(&turn_y, &beyond));
    let error = rotate_back(&turn, &subtract(point, &first.end()));
    let columns = [first_x, first_y, second_x, second_y, third_x, third_y];
    (subtract(&error, &beyond), columns)
}

/// (JJᵀ + λI)⁻¹ v by cofactors.
#[inline(always)]
fn solve_damped(jacobian: &[Vector; DOF], v: &Vector) -> Vector {
    let (mut xx, mut yy, mut zz) = (DAMPING, DAMPING, DAMPING);
    let (mut xy, mut xz, mut yz) = (0.0, 0.0, 0.0);
    for [x, y, z] in jacobian {
        xx += x * x;
        yy += y * y;
        zz += z * z;
        xy += x * y;
        xz += x * z;
        yz += y * z;
    }
    let (c00, c01, c02) = (yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy);
    let (c11, c12, c22) = (xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy);
    let inverse = 1.0 / (xx * c00 + xy * c01 + xz * c02);
    [
        (c00 * v[0] + c01 * v[1] + c02 * v[2]) * inverse,
        (c01 * v[0] + c11 * v[1] + c12 * v[2]) * inverse,
        (c02 * v[0] + c12 * v[1] + c22 * v[2]) * inverse,
    ]
}

/// Brings the bending pairs (x, y) of one section of many shapes inside the bending limit.
#[inline(always)]
pub(super) fn project_section(limit: f64, x: &mut [f64], y: &mut [f64]) {
    for (x, y) in x.chunks_mut(CHUNK).zip(y.chunks_mut(CHUNK)) {
        let mut largest = 0.0_f64;
        for (x, y) in x.iter().zip(&*y) {
            let squared = x * x + y * y;
            largest = if squared > largest { squared } else { largest };
        }
        if largest > limit * limit {
            for (x, y) in x.iter_mut().zip(y) {
                let squared = *x * *x + *y * *y;
                let inside = limit / squared.sqrt();
                let factor = if squared > limit * limit { inside } else { 1.0 };
                (*x, *y) = (*x * factor, *y * factor);
            }
        }
    }
}

#[inline(always)]
fn dot(a: &Vector, b: &Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
pub(super) fn add(a: &Vector, b: &Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline(always)]
fn subtract(a: &Vector, b: &Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
fn cross(a: &Vector, b: &Vector) -> Vector {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

#[inline(always)]
pub(super) fn rotate(rows: &Rotation, v: &Vector) -> Vector {
    [dot(&rows[0], v), dot(&rows[1], v), dot(&rows[2], v)]
}

#[inline(always)]
fn rotate_back(rows: &Rotation, v: &Vector) -> Vector {
    [
        rows[0][0] * v[0] + rows[1][0] * v[1] + rows[2][0] * v[2],
        rows[0][1] * v[0] + rows[1][1] * v[1] + rows[2][1] * v[2],
        rows[0][2] * v[0] + rows[1][2] * v[1] + rows[2][2] * v[2],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::unit_robot;
    use nalgebra::Matrix3;
    use pcc_model::{Configuration, Point, Robot};

    /// From straight to bent by almost π.
    const SHAPES: [Shape; 4] = [
        [0.0; DOF],
        [1e-9, 0.0, 0.3, -0.2, 0.0, 1e-5],
        [0.9, -0.4, -1.0, 0.6, 0.4, 1.2],
        [3.1, 0.0, -2.0, 2.3, 0.0, -3.1],
    ];

    #[test]
    fn the_step_is_the_models_damped_one() {
        let robot = Robot {
            section_lengths: [1.0, 0.7, 1.2],
            ..(*unit_robot()).clone()
        };
        let (point, wish) = (Point::new(0.4, -0.3, 1.9), [0.1, -0.2, 0.3, 0.0, 0.2, -0.1]);
        for shape in SHAPES {
            let (q, w) = (Configuration::from(shape), Configuration::from(wish));
            let error = point - robot.tip(&q);
            let jacobian = robot.backbone(&q).tip_jacobian();
            let normal = jacobian * jacobian.transpose() + Matrix3::identity() * DAMPING;
            let pull = normal.cholesky().unwrap().solve(&(error - jacobian * w));
            let expected = q + w + jacobian.transpose() * pull;
            let step = tip_step(&robot.section_lengths, &shape, &point.into(), &wish);
            assert!((step.squared_distance - error.norm_squared()).abs() < 1e-13);
            let miss = (Configuration::from(step.next) - expected).norm();
            assert!(miss < 1e-9 * expected.norm().max(1.0), "{miss}");
        }
    }

    #[test]
    fn projection_moves_only_what_is_beyond_the_limit() {
        let (mut x, mut y) = ([0.3, 3.0, 0.0, 0.0], [0.4, 4.0, 0.0, -2.0]);
        project_section(1.0, &mut x, &mut y);
        assert_eq!(
            (x, y),
            ([0.3, 0.6000000000000001, 0.0, 0.0], [0.4, 0.8, 0.0, -1.0])
        );
    }
}
