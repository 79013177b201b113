//! The bending limit: a disc for each section.

use crate::{Configuration, Robot, SECTIONS};

impl Robot {
    /// Bending angle θ_i of each section, rad.
    #[must_use]
    pub fn bending_angles(&self, shape: &Configuration) -> [f64; SECTIONS] {
        std::array::from_fn(|i| {
            let (x, y) = (shape[2 * i], shape[2 * i + 1]);
            (x * x + y * y).sqrt()
        })
    }

    /// Largest θ_i minus the limit, rad: negative inside, infinite for a shape with a component that is NaN.
    #[must_use]
    pub fn limit_excess(&self, shape: &Configuration) -> f64 {
        let angles = self.bending_angles(shape);
        if angles.iter().any(|angle| angle.is_nan()) {
            return f64::INFINITY;
        }
        angles.into_iter().fold(0.0, f64::max) - self.bending_limit
    }

    /// The nearest configuration within the bending limit, to rounding.
    #[must_use]
    pub fn project_to_limits(&self, shape: &Configuration) -> Configuration {
        let mut projected = *shape;
        for (i, angle) in self.bending_angles(shape).into_iter().enumerate() {
            if angle > self.bending_limit {
                projected[2 * i] *= self.bending_limit / angle;
                projected[2 * i + 1] *= self.bending_limit / angle;
            }
        }
        projected
    }
}
