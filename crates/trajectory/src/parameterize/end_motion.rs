//! How a motion begins and ends.

use crate::Knot;
use pcc_model::Configuration;

/// Velocity and acceleration at an end of a motion.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EndMotion {
    /// dζ/dt, rad/s.
    pub velocity: Configuration,
    /// d²ζ/dt², rad/s².
    pub acceleration: Configuration,
}

/// How a motion begins and ends; at rest by default.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EndMotions {
    /// Where it begins.
    pub start: EndMotion,
    /// Where it ends.
    pub finish: EndMotion,
}

impl EndMotion {
    pub(crate) fn is_resting(&self) -> bool {
        self.velocity == Configuration::zeros() && self.acceleration == Configuration::zeros()
    }

    pub(crate) fn is_finite(&self) -> bool {
        self.velocity.norm_squared().is_finite() && self.acceleration.norm_squared().is_finite()
    }

    pub(crate) fn knot(&self, position: Configuration) -> Knot {
        Knot {
            time: 0.0,
            position,
            velocity: self.velocity,
            acceleration: self.acceleration,
        }
    }

    /// The same motion seen backwards in time.
    pub(crate) fn reversed(&self) -> Self {
        Self {
            velocity: -self.velocity,
            acceleration: self.acceleration,
        }
    }
}
