//! Vectors of four configurations or points at once.
//!
//! Loops are written out, here and in all code for several configurations at once: closures would not be compiled for the
//! processor's vector instructions.

use fearless_simd::f64x4;
use fearless_simd::prelude::*;
use nalgebra::SVector;

/// Configurations that are handled together.
pub const LANES: usize = 4;

/// Four configurations (rad) or points (any frame and unit), component by component: `[row][lane]`.
#[must_use]
#[inline(always)]
pub fn side_by_side<S: Simd, const ROWS: usize>(
    simd: S,
    four: &[SVector<f64, ROWS>; LANES],
) -> [f64x4<S>; ROWS] {
    let [a, b, c, d] = four;
    let mut rows = [f64x4::splat(simd, 0.0); ROWS];
    for (row, lanes) in rows.iter_mut().enumerate() {
        *lanes = [a[row], b[row], c[row], d[row]].simd_into(simd);
    }
    rows
}

/// Four configurations (rad) or points (any frame and unit) from their components `[row][lane]`: the reverse of [`side_by_side`].
#[must_use]
#[inline(always)]
pub fn one_by_one<S: Simd, const ROWS: usize>(
    rows: &[f64x4<S>; ROWS],
) -> [SVector<f64, ROWS>; LANES] {
    let mut four = [SVector::zeros(); LANES];
    for (row, lanes) in rows.iter().enumerate() {
        for (lane, value) in lanes.iter().enumerate() {
            four[lane][row] = *value;
        }
    }
    four
}

/// Scalar products of four pairs of vectors, axis by axis.
#[inline(always)]
pub(crate) fn dot<S: Simd>(a: &[f64x4<S>; 3], b: &[f64x4<S>; 3]) -> f64x4<S> {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// |v|² of four vectors, axis by axis.
#[must_use]
#[inline(always)]
pub fn norms_squared<S: Simd>([x, y, z]: &[f64x4<S>; 3]) -> f64x4<S> {
    *x * *x + *y * *y + *z * *z
}
