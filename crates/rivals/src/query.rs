//! What an attempt is asked for.

use collision::Ball;
use pcc_model::{Configuration, Point, UnitRobot};

/// What an attempt is asked for.
#[derive(Clone, Copy)]
pub struct Query<'a> {
    /// The robot whose tubes are to stay clear.
    pub robot: &'a UnitRobot,
    /// The obstacles.
    pub balls: &'a [Ball],
    /// The configuration that the path begins in.
    pub start: Configuration,
    /// The tip position that it is to end in.
    pub target: Point,
}
