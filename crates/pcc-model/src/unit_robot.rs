//! A robot whose lengths are section lengths, as a type of its own.

use crate::{Point, Robot, SECTIONS};
use std::ops::Deref;

/// A robot in units of its own section length: each section is 1 long, and all other lengths are multiples of a section's.
///
/// Planning, data sets and the daemon's execution take this type, and so never a [`Robot`] in metres by mistake. It is made in
/// one place, [`Robot::to_unit`], and reads as a [`Robot`] where a unit of length does not matter.
#[derive(Clone, Debug, PartialEq)]
pub struct UnitRobot {
    robot: Robot,
    section_length_m: f64,
}

impl UnitRobot {
    /// This robot with the radius of each section's body larger by its padding, section lengths.
    #[must_use]
    pub fn with_tube_padding(&self, padding: &[f64; SECTIONS]) -> Self {
        Self {
            robot: self.robot.with_tube_padding(padding),
            ..*self
        }
    }

    /// The length of a section, metres: the unit of all lengths of this robot.
    #[must_use]
    pub fn section_length_m(&self) -> f64 {
        self.section_length_m
    }

    /// A length in metres, in section lengths.
    #[must_use]
    pub fn in_section_lengths(&self, length_m: f64) -> f64 {
        length_m / self.section_length_m
    }

    /// A position in metres, or a velocity in m/s, in section lengths.
    #[must_use]
    pub fn point_in_section_lengths(&self, point_m: [f64; 3]) -> Point {
        Point::from(point_m) / self.section_length_m
    }

    /// A length in section lengths, in metres.
    #[must_use]
    pub fn in_metres(&self, length: f64) -> f64 {
        length * self.section_length_m
    }
}

impl Deref for UnitRobot {
    type Target = Robot;

    fn deref(&self) -> &Robot {
        &self.robot
    }
}

impl Robot {
    /// This robot, in metres, in units of its section length, if all three sections are equally long (to 1e-9 of their length).
    #[must_use]
    pub fn to_unit(&self) -> Option<UnitRobot> {
        let section_length_m = self.equal_section_length()?;
        Some(UnitRobot {
            robot: self.scaled(1.0 / section_length_m),
            section_length_m,
        })
    }
}
