//! Kinematics of eight configurations at a time, and the damped step of the tip towards a point.
//!
//! Everything about a section of bending angle θ, s = θ², follows from two power series without any division:
//! q = (1 − A)/s and r = (1/2 − B)/s, so that A = 1 − s q, B = 1/2 − s r, dA/ds = (q − B)/2, dB/ds = r − q/2.

use super::lanes::Lanes;
use pcc_model::{DOF, Robot, SECTIONS};

/// λ of the damped pseudo-inverse Jᵀ(JJᵀ + λI)⁻¹ (docs/evaluation.md "The reference setting").
pub(super) const DAMPING: f64 = 1e-4;
/// Terms of the two series: the next one is below 1e-16 up to a bending angle of π.
const TERMS: usize = 13;

/// Three components.
pub(super) type Vector = [Lanes; 3];
/// Eight configurations.
pub(super) type Shapes = [Lanes; DOF];

/// What of the robot matters here.
#[derive(Clone, Copy)]
pub(super) struct Limbs {
    /// Arc length of each section.
    pub(super) lengths: [f64; SECTIONS],
    /// Largest bending angle, rad, at most π.
    pub(super) limit: f64,
}

impl Limbs {
    pub(super) fn of(robot: &Robot) -> Self {
        Self {
            lengths: robot.section_lengths,
            limit: robot.bending_limit,
        }
    }
}

/// A section, or the part of it from its base.
#[derive(Clone, Copy)]
pub(super) struct Arc {
    x: Lanes,
    y: Lanes,
    length: f64,
    a: Lanes,
    b: Lanes,
    q: Lanes,
    r: Lanes,
    cosine: Lanes,
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
    pub(super) fn new(x: Lanes, y: Lanes, length: f64) -> Self {
        let s = x * x + y * y;
        let [mut q, mut r] = SERIES[TERMS - 1].map(Lanes::splat);
        for [q_term, r_term] in SERIES[..TERMS - 1].iter().rev() {
            q = q * s + Lanes::splat(*q_term);
            r = r * s + Lanes::splat(*r_term);
        }
        let b = Lanes::splat(0.5) - s * r;
        Self {
            x,
            y,
            length,
            a: Lanes::splat(1.0) - s * q,
            b,
            q,
            r,
            cosine: Lanes::splat(1.0) - s * b,
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
        let (x, y, one) = (self.x, self.y, Lanes::splat(1.0));
        let (qx, qy, b) = (self.q * x, self.q * y, self.b * side);
        let cross = qx * y;
        [
            [one - qy * y, cross, -(b * y)],
            [cross, one - qx * x, b * x],
        ]
    }

    /// Rows of the rotation from the base to the end.
    #[inline(always)]
    pub(super) fn rotation(&self) -> [Vector; 3] {
        let (x, y, one) = (self.x, self.y, Lanes::splat(1.0));
        let (ax, ay, bx, by) = (self.a * x, self.a * y, self.b * x, self.b * y);
        let cross = bx * y;
        [
            [one - by * y, cross, ay],
            [cross, one - bx * x, -ax],
            [-ay, ax, self.cosine],
        ]
    }
}

/// What one look at the tips finds out.
pub(super) struct TipStep {
    /// Squared distance of each tip to its point.
    pub(super) squared_distance: Lanes,
    /// The shapes after one damped step towards the points, inside the limits.
    pub(super) next: Shapes,
}

/// Looks at the tips of eight shapes and makes the damped step J⁺(e − J w) + w towards `points` with the wish w.
#[inline(always)]
pub(super) fn tip_step(limbs: &Limbs, shapes: &Shapes, points: &Vector, wish: &Shapes) -> TipStep {
    let (error, jacobian) = tip_in_first_frame(&limbs.lengths, shapes, points);
    let wished = [0, 1, 2].map(|axis| {
        let mut sum = jacobian[0][axis] * wish[0];
        for d in 1..DOF {
            sum = sum + jacobian[d][axis] * wish[d];
        }
        sum
    });
    let pull = solve_damped(&jacobian, &subtract(&error, &wished));
    let mut next = *shapes;
    for d in 0..DOF {
        next[d] = next[d] + (wish[d] + dot(&jacobian[d], &pull));
    }
    project(limbs.limit, &mut next);
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
    shapes: &Shapes,
    points: &Vector,
) -> (Vector, [Vector; DOF]) {
    let [first, second, third] =
        [0, 1, 2].map(|i| Arc::new(shapes[2 * i], shapes[2 * i + 1], lengths[i]));
    let turn = second.rotation();
    let third_in_first = rotate(&turn, &third.end());
    let beyond = add(&second.end(), &third_in_first);
    let third_columns = third.end_derivatives().map(|d| rotate(&turn, &d));
    let (linear, angular) = (second.end_derivatives(), second.angular_derivatives(1.0));
    let second_columns = [0, 1].map(|k| add(&linear[k], &cross(&angular[k], &third_in_first)));
    let turn = first.rotation();
    let (linear, angular) = (first.end_derivatives(), first.angular_derivatives(-1.0));
    let first_columns = [0, 1].map(|k| {
        add(
            &rotate_back(&turn, &linear[k]),
            &cross(&angular[k], &beyond),
        )
    });
    let error = rotate_back(&turn, &subtract(points, &first.end()));
    let columns = [
        first_columns[0],
        first_columns[1],
        second_columns[0],
        second_columns[1],
        third_columns[0],
        third_columns[1],
    ];
    (subtract(&error, &beyond), columns)
}

/// (JJᵀ + λI)⁻¹ v by cofactors.
#[inline(always)]
fn solve_damped(jacobian: &[Vector; DOF], v: &Vector) -> Vector {
    let gram = |a: usize, b: usize| {
        let mut sum = jacobian[0][a] * jacobian[0][b];
        for column in &jacobian[1..] {
            sum = sum + column[a] * column[b];
        }
        sum
    };
    let damping = Lanes::splat(DAMPING);
    let (xx, yy, zz) = (
        gram(0, 0) + damping,
        gram(1, 1) + damping,
        gram(2, 2) + damping,
    );
    let (xy, xz, yz) = (gram(0, 1), gram(0, 2), gram(1, 2));
    let (c00, c01, c02) = (yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy);
    let (c11, c12, c22) = (xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy);
    let inverse = Lanes::splat(1.0) / (xx * c00 + xy * c01 + xz * c02);
    [
        (c00 * v[0] + c01 * v[1] + c02 * v[2]) * inverse,
        (c01 * v[0] + c11 * v[1] + c12 * v[2]) * inverse,
        (c02 * v[0] + c12 * v[1] + c22 * v[2]) * inverse,
    ]
}

/// Brings eight shapes inside the bending limit, section by section.
#[inline(always)]
fn project(limit: f64, shapes: &mut Shapes) {
    for i in 0..SECTIONS {
        let (x, y) = (shapes[2 * i], shapes[2 * i + 1]);
        let s = x * x + y * y;
        if s.any_above(limit * limit) {
            let one = Lanes::splat(1.0);
            let inside = s.choose_below(
                Lanes::splat(limit * limit),
                one,
                Lanes::splat(limit) / s.sqrt(),
            );
            (shapes[2 * i], shapes[2 * i + 1]) = (x * inside, y * inside);
        }
    }
}

#[inline(always)]
pub(super) fn dot(a: &Vector, b: &Vector) -> Lanes {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
pub(super) fn add(a: &Vector, b: &Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline(always)]
pub(super) fn subtract(a: &Vector, b: &Vector) -> Vector {
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

/// R v, R given by its rows.
#[inline(always)]
pub(super) fn rotate(rows: &[Vector; 3], v: &Vector) -> Vector {
    [dot(&rows[0], v), dot(&rows[1], v), dot(&rows[2], v)]
}

/// Rᵀ v, R given by its rows.
#[inline(always)]
fn rotate_back(rows: &[Vector; 3], v: &Vector) -> Vector {
    [0, 1, 2].map(|k| rows[0][k] * v[0] + rows[1][k] * v[1] + rows[2][k] * v[2])
}
