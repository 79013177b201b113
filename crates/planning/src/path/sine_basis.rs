//! Smooth changes of a path: sine series that vanish at both ends.

use crate::path::waypoints::{WAYPOINTS, parameter};
use pcc_model::{Configuration, DOF};
use std::f64::consts::PI;

/// Sine coefficients a path is described by beside its ends, per degree of freedom.
pub(super) const TERMS: usize = 12;

/// Unknowns of a smooth change.
pub(crate) const UNKNOWNS: usize = TERMS * DOF;

/// sin((k+1) π u_h) for every waypoint h and term k.
pub struct SineBasis {
    values: [[f64; TERMS]; WAYPOINTS],
}

impl Default for SineBasis {
    /// The sines of all terms at all waypoints.
    fn default() -> Self {
        let value = |h: usize, k: usize| ((k + 1) as f64 * PI * parameter(h)).sin();
        Self {
            values: std::array::from_fn(|h| std::array::from_fn(|k| value(h, k))),
        }
    }
}

impl SineBasis {
    /// Values of all terms at waypoint h.
    pub(crate) fn at(&self, h: usize) -> &[f64; TERMS] {
        &self.values[h]
    }

    /// The change of waypoint h that the coefficients (term-major) make.
    #[must_use]
    pub fn change(&self, h: usize, coefficients: &[f64]) -> Configuration {
        let mut change = Configuration::zeros();
        for (value, block) in self.values[h].iter().zip(coefficients.chunks_exact(DOF)) {
            change += *value * Configuration::from_column_slice(block);
        }
        change
    }

    /// Coefficients (term-major) of the residual of a path to the straight segment between its ends.
    /// The discrete sines are orthogonal, so this is the least-squares fit.
    #[must_use]
    pub fn analyse(&self, path: &[Configuration]) -> [f64; UNKNOWNS] {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path::waypoints::straight_path;

    #[test]
    fn analysis_recovers_what_synthesis_put_in() {
        let basis = SineBasis::default();
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
}
