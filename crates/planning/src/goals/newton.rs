//! Newton steps of four tips at once, inside the bending discs (decision 0019).

use fearless_simd::prelude::*;
use fearless_simd::{f64x4, mask64x4};
use pcc_model::{DOF, SECTIONS, UnitRobot, norms_squared};

/// Damping of the pseudo-inverse (docs/evaluation.md "Targets") for errors of one section length or more; in proportion below.
const DAMPING: f64 = 1e-4;

/// Four vectors, axis by axis.
pub(crate) type Points<S> = [f64x4<S>; 3];
/// Four configurations, or changes of configurations, component by component.
pub(crate) type Configurations<S> = [f64x4<S>; DOF];
/// Four tip Jacobians, column by column.
pub(crate) type Jacobians<S> = [Points<S>; DOF];

/// The changes W Jᵀ (J W Jᵀ + λ)⁻¹ `errors` of least norm, with the weight `free` of each section in W, and the lanes for which they can
/// be computed.
#[inline(always)]
pub(crate) fn damped_steps<S: Simd>(
    jacobians: &Jacobians<S>,
    free: &[f64x4<S>; SECTIONS],
    errors: &Points<S>,
) -> (Configurations<S>, mask64x4<S>) {
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

/// Squared bending angles of each section, rad².
#[inline(always)]
pub(crate) fn bending_squares<S: Simd>(configurations: &Configurations<S>) -> [f64x4<S>; SECTIONS] {
    let [x1, y1, x2, y2, x3, y3] = *configurations;
    [x1 * x1 + y1 * y1, x2 * x2 + y2 * y2, x3 * x3 + y3 * y3]
}

/// The lanes in which a section bends beyond its limit, or by what is not a number.
#[inline(always)]
pub(crate) fn beyond_limits<S: Simd>(
    robot: &UnitRobot,
    configurations: &Configurations<S>,
) -> mask64x4<S> {
    let limit = robot.bending_limit * robot.bending_limit;
    let [first, second, third] = bending_squares(configurations);
    !(first.simd_le(limit) & second.simd_le(limit) & third.simd_le(limit))
}

/// The nearest configurations within the bending limits, to rounding.
#[inline(always)]
pub(crate) fn within_limits<S: Simd>(
    robot: &UnitRobot,
    configurations: &Configurations<S>,
) -> Configurations<S> {
    let (limit, mut within) = (robot.bending_limit, *configurations);
    for (section, square) in bending_squares(configurations).into_iter().enumerate() {
        let beyond = square.simd_gt(limit * limit);
        let scale = beyond.select(limit / square.sqrt(), square * 0.0 + 1.0);
        within[2 * section] *= scale;
        within[2 * section + 1] *= scale;
    }
    within
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::unit_robot;
    use crate::search::random_configuration::random_configuration;
    use fearless_simd::{Level, dispatch};
    use nalgebra::{Matrix3, Matrix3x6, Vector3};
    use pcc_model::{Configuration, LANES, one_by_one, side_by_side};
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    type Case = (Matrix3x6<f64>, [f64; SECTIONS], Vector3<f64>);

    fn steps(cases: &[Case; LANES]) -> ([Configuration; LANES], u64) {
        dispatch!(Level::new(), simd => {
            let four = |of: &dyn Fn(&Case) -> f64| f64x4::simd_from(simd, cases.each_ref().map(of));
            let jacobians = std::array::from_fn(|column| {
                std::array::from_fn(|axis| four(&|case| case.0[(axis, column)]))
            });
            let free = std::array::from_fn(|section| four(&|case| case.1[section]));
            let errors = std::array::from_fn(|axis| four(&|case| case.2[axis]));
            let (steps, solvable) = damped_steps(&jacobians, &free, &errors);
            (one_by_one(&steps), solvable.to_bitmask())
        })
    }

    #[test]
    fn steps_are_the_damped_ones_of_each_lane() {
        let mut rng = Pcg64::seed_from_u64(3);
        for size in [1e-6, 0.1, 3.0] {
            let cases: [Case; LANES] = std::array::from_fn(|_| {
                let jacobian = Matrix3x6::from_fn(|_, _| rng.random_range(-1.0..1.0));
                let free = std::array::from_fn(|_| rng.random_range(0.02..1.0));
                (
                    jacobian,
                    free,
                    Vector3::from_fn(|_, _| rng.random_range(-size..size)),
                )
            });
            let (steps, solvable) = steps(&cases);
            assert_eq!(solvable, 0b1111);
            for ((jacobian, free, error), step) in cases.iter().zip(steps) {
                let weighted = Configuration::from_fn(|row, _| free[row / 2]);
                let weighted = nalgebra::Matrix6::from_diagonal(&weighted) * jacobian.transpose();
                let damping = Matrix3::identity() * (DAMPING * error.norm().min(1.0));
                let solved = (jacobian * weighted + damping)
                    .cholesky()
                    .unwrap()
                    .solve(error);
                assert!((weighted * solved - step).norm() < 1e-12 * error.norm().max(1e-3));
            }
        }
    }

    #[test]
    fn a_lane_that_cannot_be_solved_leaves_the_others() {
        let good = (
            Matrix3x6::identity(),
            [1.0; SECTIONS],
            Vector3::new(0.1, 0.2, 0.3),
        );
        let at_rest = (Matrix3x6::zeros(), [1.0; SECTIONS], Vector3::zeros());
        let unknown = (Matrix3x6::repeat(f64::NAN), [1.0; SECTIONS], good.2);
        let (steps, solvable) = steps(&[good, at_rest, unknown, good]);
        assert_eq!(solvable, 0b1001);
        assert_eq!(steps[0], steps[3]);
    }

    #[test]
    fn limits_are_those_of_the_robot() {
        let robot = unit_robot();
        let mut rng = Pcg64::seed_from_u64(4);
        for case in 0..1000 {
            let mut configurations: [Configuration; LANES] = std::array::from_fn(|lane| {
                random_configuration(&robot, &mut rng) * (0.5 + 0.3 * lane as f64)
            });
            if case % 10 == 0 {
                configurations[1][case % DOF] = f64::NAN;
            }
            let (beyond, within) = dispatch!(Level::new(), simd => {
                let lanes = side_by_side(simd, &configurations);
                (beyond_limits(&robot, &lanes).to_bitmask(), one_by_one(&within_limits(&robot, &lanes)))
            });
            for (lane, configuration) in configurations.iter().enumerate() {
                assert_eq!(
                    (beyond >> lane) & 1 == 1,
                    robot.limit_excess(configuration) > 0.0
                );
                let nearest = robot.project_to_limits(configuration);
                assert!(configuration.norm().is_nan() || (within[lane] - nearest).norm() < 1e-15);
            }
        }
    }
}
