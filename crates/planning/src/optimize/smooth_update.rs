//! Smooth changes of a path that move given waypoints by given distances: least squares with few rows.
//!
//! Minimises Σ (gᵢᵀ change(hᵢ) − distanceᵢ)² + Σ_k d_k ‖c_k‖² over the sine coefficients c. With so few rows as contacts,
//! the dual problem is the smaller one: (K + 1) y = distance, K_ij = κ(hᵢ, hⱼ) gᵢ·gⱼ, κ(h, h′) = Σ_k s_k(h) s_k(h′) / d_k,
//! and change(h) = Σᵢ κ(h, hᵢ) yᵢ gᵢ.

use crate::path::cholesky::{factorise, substitute};
use crate::path::sine_basis::SineBasis;
use crate::path::waypoints::WAYPOINTS;
use pcc_model::Configuration;

/// Cost of a coefficient of low frequency.
const CHANGE_COST: f64 = 1e-3;

/// Cost d of coefficient k, which grows with the fifth power of its frequency: a path that is pushed stays smooth.
fn cost(k: usize) -> f64 {
    CHANGE_COST * (1.0 + ((k + 1) as f64 / 3.0).powi(5))
}

/// How far a push at one waypoint moves the others: κ, for all pairs of waypoints.
pub(crate) struct PushKernel {
    values: Box<[[f64; WAYPOINTS]; WAYPOINTS]>,
}

impl PushKernel {
    pub(crate) fn new(basis: &SineBasis) -> Self {
        let value = |h: usize, other: usize| {
            let terms = basis.at(h).iter().zip(basis.at(other));
            terms.enumerate().map(|(k, (a, b))| a * b / cost(k)).sum()
        };
        let row = |h| std::array::from_fn(|other| value(h, other));
        Self {
            values: Box::new(std::array::from_fn(row)),
        }
    }
}

struct Push {
    waypoint: usize,
    gradient: Configuration,
    distance: f64,
}

/// Pushes that are solved together; the memory is kept from one system to the next.
#[derive(Default)]
pub(super) struct Pushes {
    rows: Vec<Push>,
    matrix: Vec<f64>,
    forces: Vec<f64>,
}

impl Pushes {
    pub(super) fn clear(&mut self) {
        self.rows.clear();
    }

    /// Asks for a change of waypoint `waypoint`, rad, whose product with `gradient` is `distance`: a clearance, section lengths, or an
    /// angle, rad.
    pub(crate) fn add(&mut self, waypoint: usize, gradient: Configuration, distance: f64) {
        self.rows.push(Push {
            waypoint,
            gradient,
            distance,
        });
    }

    /// The change of each waypoint, radians; none if the system cannot be solved.
    pub(crate) fn solve(&mut self, kernel: &PushKernel) -> Option<[Configuration; WAYPOINTS]> {
        let count = self.rows.len();
        if count == 0 {
            return Some([Configuration::zeros(); WAYPOINTS]);
        }
        self.matrix.clear();
        self.matrix.resize(count * count, 0.0);
        for (i, (row, push)) in self
            .matrix
            .chunks_exact_mut(count)
            .zip(&self.rows)
            .enumerate()
        {
            let reach = &kernel.values[push.waypoint];
            for (value, other) in row[..=i].iter_mut().zip(&self.rows) {
                *value = reach[other.waypoint] * push.gradient.dot(&other.gradient);
            }
            row[i] += 1.0;
        }
        if !factorise(&mut self.matrix, count) {
            return None;
        }
        self.forces.clear();
        self.forces
            .extend(self.rows.iter().map(|push| push.distance));
        substitute(&self.matrix, &mut self.forces);
        Some(self.changes(kernel))
    }

    fn changes(&self, kernel: &PushKernel) -> [Configuration; WAYPOINTS] {
        let mut forces = [Configuration::zeros(); WAYPOINTS];
        let mut is_pushed = [false; WAYPOINTS];
        for (push, force) in self.rows.iter().zip(&self.forces) {
            forces[push.waypoint] += push.gradient * *force;
            is_pushed[push.waypoint] = true;
        }
        let mut changes = [Configuration::zeros(); WAYPOINTS];
        for h in (0..WAYPOINTS).filter(|&h| is_pushed[h]) {
            for (change, reach) in changes.iter_mut().zip(&kernel.values[h]) {
                *change += forces[h] * *reach;
            }
        }
        changes
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path::sine_basis::UNKNOWNS;
    use crate::path::smooth_least_squares::SmoothLeastSquares;
    use pcc_model::DOF;

    #[test]
    fn the_dual_problem_has_the_solution_of_the_primal_one() {
        let basis = SineBasis::default();
        let kernel = PushKernel::new(&basis);
        let (mut pushes, mut primal) = (Pushes::default(), SmoothLeastSquares::default());
        for row in 0..25 {
            let gradient = Configuration::from_fn(|i, _| ((row * 7 + i) as f64).sin());
            let (waypoint, distance) = (3 + row * 13 % 58, 0.1 * (row as f64).cos());
            pushes.add(waypoint, gradient, distance);
            primal.push(waypoint, &gradient, distance, 1.0);
        }
        let damping: [f64; UNKNOWNS] = std::array::from_fn(|i| cost(i / DOF));
        let coefficients = primal.solve(&basis, &damping, &[0.0; UNKNOWNS]).unwrap();
        let changes = pushes.solve(&kernel).unwrap();
        assert!(changes[20].norm() > 1e-3, "there is a change");
        for (h, change) in changes.iter().enumerate() {
            let expected = basis.change(h, &coefficients);
            assert!((change - expected).amax() < 1e-8, "waypoint {h}");
        }
        pushes.clear();
        assert_eq!(pushes.solve(&kernel).unwrap()[20], Configuration::zeros());
    }
}
