//! The bending limit: a disc for each section.

use crate::{Configuration, Robot, SECTIONS};

impl Robot {
    /// Bending angle θ_i of each section, rad.
    #[must_use]
    pub fn bending_angles(&self, configuration: &Configuration) -> [f64; SECTIONS] {
        std::array::from_fn(|i| {
            let (x, y) = (configuration[2 * i], configuration[2 * i + 1]);
            (x * x + y * y).sqrt()
        })
    }

    /// Largest θ_i minus the limit, rad: negative inside, infinite for a configuration with a component that is NaN.
    #[must_use]
    pub fn limit_excess(&self, configuration: &Configuration) -> f64 {
        let angles = self.bending_angles(configuration);
        if angles.iter().any(|angle| angle.is_nan()) {
            return f64::INFINITY;
        }
        angles.into_iter().fold(0.0, f64::max) - self.bending_limit
    }

    /// The nearest configuration within the bending limit, to rounding.
    #[must_use]
    pub fn project_to_limits(&self, configuration: &Configuration) -> Configuration {
        let mut projected = *configuration;
        for (i, angle) in self.bending_angles(configuration).into_iter().enumerate() {
            if angle > self.bending_limit {
                projected[2 * i] *= self.bending_limit / angle;
                projected[2 * i + 1] *= self.bending_limit / angle;
            }
        }
        projected
    }
}
