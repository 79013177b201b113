//! A robot whose lengths are section lengths, as a type of its own.

use crate::{Robot, SECTIONS};
use std::ops::Deref;

/// A robot in units of its own section length: each section is 1 long, and all other lengths are multiples of a section's.
///
/// Planning, data sets and the daemon's execution take this type, and so never a [`Robot`] in metres by mistake. It is made in
/// one place, [`Robot::to_unit`], and reads as a [`Robot`] where a unit of length does not matter.
#[derive(Clone, Debug, PartialEq)]
pub struct UnitRobot(Robot);

impl UnitRobot {
    /// This robot with the radius of each section's body larger by its padding, section lengths.
    #[must_use]
    pub fn with_tube_padding(&self, padding: &[f64; SECTIONS]) -> Self {
        Self(self.0.with_tube_padding(padding))
    }
}

impl Deref for UnitRobot {
    type Target = Robot;

    fn deref(&self) -> &Robot {
        &self.0
    }
}

impl Robot {
    /// This robot, in metres, in units of its section length, if all three sections are equally long (to 1e-9 of their length).
    #[must_use]
    pub fn to_unit(&self) -> Option<UnitRobot> {
        Some(UnitRobot(self.scaled(1.0 / self.equal_section_length()?)))
    }
}
