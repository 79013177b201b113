//! Least squares in the sine coefficients of a smooth change of a path.

use crate::path::cholesky::{factorise, substitute};
use crate::path::sine_basis::{SineBasis, TERMS, UNKNOWNS};
use crate::path::waypoints::WAYPOINTS;
use nalgebra::SMatrix;
use pcc_model::{Configuration, DOF};

type Block = SMatrix<f64, DOF, DOF>;

/// Weighted linear least squares in the coefficients of a smooth change.
///
/// A row that concerns waypoint h is s_h ⊗ g, with the sines of that waypoint and a gradient g. The normal matrix is
/// therefore Σ_h s_h s_hᵀ ⊗ Σ g gᵀ: it takes as long with many rows as with few.
pub struct SmoothLeastSquares {
    /// Σ g gᵀ of each waypoint.
    own: [Block; WAYPOINTS],
    /// Σ a bᵀ of the rows that concern a waypoint with gradient a and the next one with gradient b.
    next: [Block; WAYPOINTS],
    /// Σ target · g.
    right: [Configuration; WAYPOINTS],
    concerned: [bool; WAYPOINTS],
}

impl Default for SmoothLeastSquares {
    /// A sum without rows.
    fn default() -> Self {
        Self {
            own: [Block::zeros(); WAYPOINTS],
            next: [Block::zeros(); WAYPOINTS],
            right: [Configuration::zeros(); WAYPOINTS],
            concerned: [false; WAYPOINTS],
        }
    }
}

impl SmoothLeastSquares {
    /// Adds `weight · (gradientᵀ change_h − target)²`.
    pub fn push(&mut self, h: usize, gradient: &Configuration, target: f64, weight: f64) {
        self.own[h] += gradient * gradient.transpose() * weight;
        self.right[h] += gradient * (weight * target);
        self.concerned[h] = true;
    }

    /// Adds `weight · (aᵀ change_h + bᵀ change_{h+1} − target)²`.
    pub fn push_pair(&mut self, h: usize, [a, b]: [&Configuration; 2], target: f64, weight: f64) {
        self.push(h, a, target, weight);
        self.push(h + 1, b, target, weight);
        self.next[h] += a * b.transpose() * weight;
    }

    /// Minimises the sum plus `Σ damping_k |c_k − c̄_k|²`, where `pull_k = damping_k c̄_k` is given.
    /// `None` where the normal matrix is not positive definite.
    #[must_use]
    pub fn solve(
        &self,
        basis: &SineBasis,
        damping: &[f64; UNKNOWNS],
        pull: &[f64; UNKNOWNS],
    ) -> Option<[f64; UNKNOWNS]> {
        let mut normal = self.normal(basis);
        for (k, d) in damping.iter().enumerate() {
            normal[k * UNKNOWNS + k] += d;
        }
        let mut right = *pull;
        for h in (0..WAYPOINTS).filter(|&h| self.concerned[h]) {
            for (sine, block) in basis.at(h).iter().zip(right.chunks_exact_mut(DOF)) {
                for (sum, part) in block.iter_mut().zip(self.right[h].iter()) {
                    *sum += sine * part;
                }
            }
        }
        factorise(&mut normal, UNKNOWNS).then(|| {
            substitute(&normal, &mut right);
            right
        })
    }

    /// The lower triangle of the normal matrix, row by row.
    fn normal(&self, basis: &SineBasis) -> Vec<f64> {
        let mut blocks = [[Block::zeros(); TERMS]; TERMS];
        for h in (0..WAYPOINTS).filter(|&h| self.concerned[h]) {
            let sines = basis.at(h);
            for l in 0..TERMS {
                let mut column = self.own[h] * sines[l];
                if h + 1 < WAYPOINTS {
                    column += self.next[h] * basis.at(h + 1)[l];
                }
                if h > 0 {
                    column += self.next[h - 1].transpose() * basis.at(h - 1)[l];
                }
                for k in l..TERMS {
                    blocks[k][l] += column * sines[k];
                }
            }
        }
        let mut normal = vec![0.0; UNKNOWNS * UNKNOWNS];
        for (row, values) in normal.chunks_exact_mut(UNKNOWNS).enumerate() {
            for (column, value) in values[..=row].iter_mut().enumerate() {
                *value = blocks[row / DOF][column / DOF][(row % DOF, column % DOF)];
            }
        }
        normal
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn least_squares_reaches_a_reachable_target() {
        let basis = SineBasis::default();
        let mut problem = SmoothLeastSquares::default();
        let gradient = Configuration::from_fn(|i, _| i as f64 + 1.0);
        problem.push(20, &gradient, 0.7, 1.0);
        let solution = problem.solve(&basis, &[1e-9; UNKNOWNS], &[0.0; UNKNOWNS]);
        assert!((gradient.dot(&basis.change(20, &solution.unwrap())) - 0.7).abs() < 1e-6);
    }

    #[test]
    fn least_squares_leaves_no_slope() {
        let basis = SineBasis::default();
        let vector = |seed: usize| Configuration::from_fn(|i, _| ((seed * 7 + i * 3) as f64).sin());
        let rows: Vec<_> = (0..40)
            .map(|r| {
                (
                    r * 17 % (WAYPOINTS - 1),
                    vector(r),
                    vector(r + 100),
                    (r as f64).cos(),
                )
            })
            .collect();
        let mut problem = SmoothLeastSquares::default();
        for (h, a, b, target) in &rows {
            problem.push_pair(*h, [a, b], *target, 2.0);
            problem.push(*h, b, 0.5, 3.0);
        }
        let (damping, pull) = ([0.3; UNKNOWNS], std::array::from_fn(|i| 0.01 * i as f64));
        let found = problem.solve(&basis, &damping, &pull).unwrap();
        let mut slope: [f64; UNKNOWNS] = std::array::from_fn(|i| damping[i] * found[i] - pull[i]);
        let mut add = |sines: &[f64; TERMS], gradient: &Configuration, residual: f64| {
            for (i, value) in slope.iter_mut().enumerate() {
                *value += residual * sines[i / DOF] * gradient[i % DOF];
            }
        };
        for (h, a, b, target) in &rows {
            let [here, there] = [0, 1].map(|next| basis.change(h + next, &found));
            let pair = 2.0 * (a.dot(&here) + b.dot(&there) - target);
            add(basis.at(*h), a, pair);
            add(basis.at(h + 1), b, pair);
            add(basis.at(*h), b, 3.0 * (b.dot(&here) - 0.5));
        }
        assert!(slope.iter().all(|s| s.abs() < 1e-9), "{slope:?}");
    }
}
