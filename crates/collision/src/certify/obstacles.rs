//! Obstacles as certificates and the search for the smallest clearance see them.

use crate::certify::motion_bound::MotionBound;
use crate::distance::chosen_sections::Chosen;
use pcc_model::{Configuration, Robot, SECTIONS};

/// Obstacles, at rest or moving, between which a body moves.
pub(crate) trait Obstacles {
    /// Where the body is at one instant, and its clearances from the obstacles.
    type State: Copy;

    /// The state at `time`, s, with the clearances of the chosen sections; +∞ for the others, which holds only within an interval in
    /// which those cannot touch.
    fn state(
        &self,
        robot: &Robot,
        configuration: &Configuration,
        time: f64,
        chosen: &Chosen,
    ) -> Self::State;

    /// The smallest clearance of each section; where one of an obstacle is not a number, that.
    fn clearances(state: &Self::State) -> [f64; SECTIONS];

    /// Lower bound of each section's clearance between two instants.
    fn lowest(
        &self,
        from: &Self::State,
        to: &Self::State,
        robot: &Robot,
        bound: &MotionBound,
    ) -> [f64; SECTIONS];
}

/// Whether a section touches an obstacle.
pub(crate) fn touches<O: Obstacles>(state: &O::State) -> bool {
    O::clearances(state)
        .iter()
        .any(|clearance| *clearance < 0.0)
}

/// The sections for which these lower bounds leave room for contact.
pub(crate) fn may_touch(lowest: [f64; SECTIONS]) -> Chosen {
    lowest.map(|clearance| clearance <= 0.0 || clearance.is_nan())
}
