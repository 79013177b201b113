//! Smooth changes of a path: sine series that vanish at both ends, and least squares in their coefficients.

use crate::path::{WAYPOINTS, parameter};
use nalgebra::{Cholesky, DMatrix, DVector};
use pcc_model::{Configuration, DOF};
use std::f64::consts::PI;

/// Sine coefficients a path is described by beside its ends, per degree of freedom.
pub(crate) const TERMS: usize = 12;

/// Unknowns of a smooth change.
pub(crate) const UNKNOWNS: usize = TERMS * DOF;

/// sin((k+1) π u_h) for every waypoint h and term k.
pub(crate) struct SineBasis {
    values: [[f64; TERMS]; WAYPOINTS],
}

impl SineBasis {
    pub(crate) fn new() -> Self {
        let value = |h: usize, k: usize| ((k + 1) as f64 * PI * parameter(h)).sin();
        Self {
            values: std::array::from_fn(|h| std::array::from_fn(|k| value(h, k))),
        }
    }

    /// Values of all terms at waypoint h.
    pub(crate) fn at(&self, h: usize) -> &[f64; TERMS] {
        &self.values[h]
    }

    /// The change of waypoint h that the coefficients (term-major) make.
    pub(crate) fn change(&self, h: usize, coefficients: &[f64]) -> Configuration {
        let mut change = Configuration::zeros();
        for (value, block) in self.values[h].iter().zip(coefficients.chunks_exact(DOF)) {
            change += *value * Configuration::from_column_slice(block);
        }
        change
    }

    /// Coefficients (term-major) of the residual of a path to the straight segment between its ends.
    /// The discrete sines are orthogonal, so this is the least-squares fit.
    pub(crate) fn analyse(&self, path: &[Configuration]) -> [f64; UNKNOWNS] {
        let (first, last) = (path[0], path[WAYPOINTS - 1]);
        let mut coefficients = [0.0; UNKNOWNS];
        for (h, waypoint) in path.iter().enumerate() {
            let residual = waypoint - first.lerp(&last, parameter(h));
            for (value, block) in self.values[h]
                .iter()
                .zip(coefficients.chunks_exact_mut(DOF))
            {
                for (c, r) in block.iter_mut().zip(residual.iter()) {
                    *c += value * r * 2.0 / (WAYPOINTS - 1) as f64;
                }
            }
        }
        coefficients
    }
}

/// Weighted linear least squares in the coefficients of a smooth change.
pub(crate) struct SmoothLeastSquares {
    rows: Vec<f64>,
    targets: Vec<f64>,
}

impl SmoothLeastSquares {
    pub(crate) fn new() -> Self {
        Self {
            rows: Vec::new(),
            targets: Vec::new(),
        }
    }

    pub(crate) fn clear(&mut self) {
        self.rows.clear();
        self.targets.clear();
    }

    /// Adds `weight · (gradientᵀ change_h − target)²`.
    pub(crate) fn push(
        &mut self,
        sines: &[f64; TERMS],
        gradient: &Configuration,
        target: f64,
        weight: f64,
    ) {
        let scale = weight.sqrt();
        self.rows.extend(
            sines
                .iter()
                .flat_map(|s| gradient.iter().map(move |g| scale * s * g)),
        );
        self.targets.push(scale * target);
    }

    /// Adds `weight · (aᵀ change_h + bᵀ change_{h+1} − target)²`.
    pub(crate) fn push_pair(
        &mut self,
        sines: [&[f64; TERMS]; 2],
        gradients: [&Configuration; 2],
        target: f64,
        weight: f64,
    ) {
        let scale = weight.sqrt();
        for (s0, s1) in sines[0].iter().zip(sines[1]) {
            self.rows.extend(
                gradients[0]
                    .iter()
                    .zip(gradients[1])
                    .map(|(a, b)| scale * (s0 * a + s1 * b)),
            );
        }
        self.targets.push(scale * target);
    }

    /// Minimises the sum plus `Σ damping_k |c_k − c̄_k|²`, where `pull_k = damping_k c̄_k` is given.
    pub(crate) fn solve(
        &self,
        damping: &[f64; UNKNOWNS],
        pull: &[f64; UNKNOWNS],
    ) -> Option<DVector<f64>> {
        let transposed = DMatrix::from_column_slice(UNKNOWNS, self.targets.len(), &self.rows);
        let mut normal = &transposed * transposed.transpose();
        for (k, d) in damping.iter().enumerate() {
            normal[(k, k)] += d;
        }
        let right = &transposed * DVector::from_column_slice(&self.targets)
            + DVector::from_column_slice(pull);
        Cholesky::new(normal).map(|c| c.solve(&right))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path::straight_path;

    #[test]
    fn analysis_recovers_what_synthesis_put_in() {
        let basis = SineBasis::new();
        let coefficients: [f64; UNKNOWNS] =
            std::array::from_fn(|i| ((i * 37 % 11) as f64 - 5.0) / 20.0);
        let mut path = straight_path(&Configuration::repeat(0.3), &Configuration::repeat(-0.4));
        for (h, waypoint) in path.iter_mut().enumerate() {
            *waypoint += basis.change(h, &coefficients);
        }
        let found = basis.analyse(&path);
        assert!(
            found
                .iter()
                .zip(&coefficients)
                .all(|(a, b)| (a - b).abs() < 1e-12)
        );
    }

    #[test]
    fn least_squares_reaches_a_reachable_target() {
        let basis = SineBasis::new();
        let mut problem = SmoothLeastSquares::new();
        let gradient = Configuration::from_fn(|i, _| i as f64 + 1.0);
        problem.push(basis.at(20), &gradient, 0.7, 1.0);
        let solution = problem.solve(&[1e-9; UNKNOWNS], &[0.0; UNKNOWNS]).unwrap();
        assert!((gradient.dot(&basis.change(20, solution.as_slice())) - 0.7).abs() < 1e-6);
    }
}
