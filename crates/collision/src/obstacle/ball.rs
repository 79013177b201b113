//! Balls.

use crate::obstacle::limits::MAX_EXTENT;
use pcc_model::Point;

/// A ball.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// Centre, base frame.
    pub centre: Point,
    /// Radius.
    pub radius: f64,
}

impl Ball {
    /// Whether its coordinates are within ±[`MAX_EXTENT`] and its radius is from 0 to it.
    #[must_use]
    pub fn is_allowed(&self) -> bool {
        self.centre.iter().all(|v| v.abs() <= MAX_EXTENT)
            && (0.0..=MAX_EXTENT).contains(&self.radius)
    }
}
