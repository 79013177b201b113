//! Newton steps of four tips at once, inside the bending discs.
//!
//! Loops are written out: closures would not take on the processor's features.

use fearless_simd::prelude::*;
use fearless_simd::{f64x4, mask64x4};
use pcc_model::{DOF, Robot, SECTIONS};

/// Shapes that are handled together.
pub(crate) const LANES: usize = 4;
/// Damping λ of the pseudo-inverse (docs/evaluation.md "Targets").
const DAMPING: f64 = 1e-4;

/// Four vectors, axis by axis.
pub(crate) type Points<S> = [f64x4<S>; 3];
/// Four shapes, or changes of shapes, component by component.
pub(crate) type Shapes<S> = [f64x4<S>; DOF];
/// Four tip Jacobians, column by column.
pub(crate) type Jacobians<S> = [Points<S>; DOF];

/// The changes of least norm that move the tips by `errors`, where every section takes the part `free` of what it could, and
/// for which lanes they can be computed.
#[inline(always)]
pub(crate) fn damped_steps<S: Simd>(
    jacobians: &Jacobians<S>,
    free: &[f64x4<S>; SECTIONS],
    errors: &Points<S>,
) -> (Shapes<S>, mask64x4<S>) {
    let damping = norms_squared(errors).sqrt().min(1.0) * DAMPING;
    let zero = damping * 0.0;
    // The upper triangle of J W Jᵀ + λ.
    let ([mut xx, mut xy, mut xz], [mut yy, mut yz], mut zz) =
        ([damping, zero, zero], [damping, zero], damping);
    for (column, [x, y, z]) in jacobians.iter().enumerate() {
        let part = free[column / 2];
        let (wx, wy, wz) = (*x * part, *y * part, *z * part);
        xx += wx * *x;
        xy += wx * *y;
        xz += wx * *z;
        yy += wy * *y;
        yz += wy * *z;
        zz += wz * *z;
    }
    // Its factors L D Lᵀ.
    let (yx, zx) = (xy / xx, xz / xx);
    let second = yy - yx * xy;
    let below = yz - zx * xy;
    let zy = below / second;
    let third = zz - zx * xz - zy * below;
    let solvable = xx.simd_gt(0.0) & second.simd_gt(0.0) & third.simd_gt(0.0);
    let [ex, ey, ez] = *errors;
    let ey = ey - yx * ex;
    let z = (ez - zx * ex - zy * ey) / third;
    let y = ey / second - zy * z;
    let x = ex / xx - yx * y - zx * z;
    let mut steps = [zero; DOF];
    for (column, step) in steps.iter_mut().enumerate() {
        let [jx, jy, jz] = jacobians[column];
        *step = (jx * x + jy * y + jz * z) * free[column / 2];
    }
    (steps, solvable)
}

#[inline(always)]
pub(crate) fn norms_squared<S: Simd>([x, y, z]: &Points<S>) -> f64x4<S> {
    *x * *x + *y * *y + *z * *z
}

/// Squared bending angles of each section, rad².
#[inline(always)]
pub(crate) fn bending_squares<S: Simd>(shapes: &Shapes<S>) -> [f64x4<S>; SECTIONS] {
    let [x1, y1, x2, y2, x3, y3] = *shapes;
    [x1 * x1 + y1 * y1, x2 * x2 + y2 * y2, x3 * x3 + y3 * y3]
}

/// The lanes in which a section bends beyond its limit.
#[inline(always)]
pub(crate) fn beyond_limits<S: Simd>(robot: &Robot, shapes: &Shapes<S>) -> mask64x4<S> {
    let [first, second, third] = bending_squares(shapes);
    first
        .max(second)
        .max(third)
        .simd_gt(robot.bending_limit.powi(2))
}

/// The nearest shapes within the bending limits, to rounding.
#[inline(always)]
pub(crate) fn within_limits<S: Simd>(robot: &Robot, shapes: &Shapes<S>) -> Shapes<S> {
    let (limit, mut within) = (robot.bending_limit, *shapes);
    for (section, square) in bending_squares(shapes).into_iter().enumerate() {
        let beyond = square.simd_gt(limit * limit);
        let scale = beyond.select(limit / square.sqrt(), square * 0.0 + 1.0);
        within[2 * section] *= scale;
        within[2 * section + 1] *= scale;
    }
    within
}
