//! A smoothing spline through values at the waypoints of a path, between fixed ends.

use crate::path::waypoints::WAYPOINTS;
use nalgebra::{DMatrix, SVector};

/// Weights of a third difference.
const DIFFERENCE: [f64; 4] = [-1.0, 3.0, -3.0, 1.0];

/// The smoothing spline with the penalty λ ∫ (d³x/dh³)² on the waypoints h = 0, …, 63 (Reinsch 1967, with third derivatives):
/// it removes waves shorter than about 2π λ^(1/6) waypoints.
pub(crate) struct Smoother {
    /// Weight of every given value in each smoothed inner one.
    weights: Vec<[f64; WAYPOINTS]>,
}

impl Smoother {
    /// The smoother with the penalty `strength` = λ, positive.
    pub(crate) fn new(strength: f64) -> Self {
        let differences = DMatrix::from_fn(WAYPOINTS - 3, WAYPOINTS, |row, column| {
            let place = column.checked_sub(row);
            place
                .and_then(|place| DIFFERENCE.get(place))
                .copied()
                .unwrap_or(0.0)
        });
        let penalty = differences.tr_mul(&differences) * strength;
        let inner = WAYPOINTS - 2;
        let system = DMatrix::identity(inner, inner) + penalty.view((1, 1), (inner, inner));
        // The inner values themselves, and what the fixed ends pull.
        let mut given = DMatrix::zeros(inner, WAYPOINTS);
        for row in 0..inner {
            given[(row, row + 1)] = 1.0;
            for end in [0, WAYPOINTS - 1] {
                given[(row, end)] -= penalty[(row + 1, end)];
            }
        }
        let solved = system
            .cholesky()
            .expect("the identity and a penalty are positive definite")
            .solve(&given);
        let row = |row| std::array::from_fn(|column| solved[(row, column)]);
        Self {
            weights: (0..inner).map(row).collect(),
        }
    }

    /// The smoothed values; the first and the last stay.
    pub(crate) fn smooth<const D: usize>(
        &self,
        values: &[SVector<f64, D>; WAYPOINTS],
    ) -> [SVector<f64, D>; WAYPOINTS] {
        let mut smooth = *values;
        for (value, weights) in smooth[1..].iter_mut().zip(&self.weights) {
            *value = values.iter().zip(weights).map(|(v, w)| v * *w).sum();
        }
        smooth
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path::waypoints::parameter;
    use nalgebra::Vector1;
    use std::f64::consts::PI;

    fn values(of: impl Fn(f64) -> f64) -> [Vector1<f64>; WAYPOINTS] {
        std::array::from_fn(|h| Vector1::new(of(parameter(h))))
    }

    #[test]
    fn parabolas_stay_and_short_waves_go() {
        let smoother = Smoother::new(1e4);
        let parabola = |u: f64| 3.0 + u - 2.0 * u * u;
        let given = values(|u| parabola(u) + 0.1 * (20.0 * PI * u).sin());
        let smooth = smoother.smooth(&given);
        for (value, wanted) in smooth.iter().zip(values(parabola)) {
            assert!((value - wanted).norm() < 2e-3, "{value} {wanted}");
        }
        assert_eq!([smooth[0], smooth[63]], [given[0], given[63]]);
    }

    #[test]
    fn more_strength_leaves_less_of_a_bump() {
        let bump = values(|u| (-((u - 0.5) / 0.15).powi(2)).exp());
        let left = |strength| Smoother::new(strength).smooth(&bump)[32].x;
        assert!(left(1e2) > 0.9 && left(1e6) < 0.7);
        assert!(left(1e2) > left(1e3) && left(1e3) > left(1e4));
    }
}
