//! One path of a data set, with the case that it answers.

use collision::{Ball, Scene, certify_polyline};
use pcc_model::{Configuration, Point, UnitRobot};

/// The part of a data set that a row belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Split {
    /// For training; code 0.
    Train,
    /// For choosing among trained models; code 1.
    Validation,
    /// For the last word; code 2.
    Test,
}

impl Split {
    pub(crate) fn code(self) -> i8 {
        match self {
            Self::Train => 0,
            Self::Validation => 1,
            Self::Test => 2,
        }
    }
}

/// One path with its target and scene.
#[derive(Clone, Debug)]
pub struct Row {
    /// Waypoints, radians.
    pub path: Vec<Configuration>,
    /// Tip position asked for, section lengths.
    pub target_tip: Point,
    /// Index of the target in its generator.
    pub target_index: i32,
    /// Index of the start at its target.
    pub start_index: i16,
    /// Index of the goal configuration at its target.
    pub ik_index: i16,
    /// The split that the row belongs to.
    pub split: Split,
    /// Obstacles, section lengths.
    pub balls: Vec<Ball>,
    /// The exact judgement of the path's collision, where there is one.
    pub check: Option<Check>,
}

/// An exact judgement of a path, whose maker may have looked at samples only.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Check {
    /// Smallest clearance of the tube over the waypoints, section lengths; +∞ without obstacles.
    pub clearance: f32,
    /// Whether the polyline through the waypoints is certified free.
    pub is_certified: bool,
}

impl Check {
    /// Judges a path of waypoints.
    pub(crate) fn of(robot: &UnitRobot, scene: &Scene, path: &[Configuration]) -> Self {
        let clearance = |shape| scene.clearance_at(robot, shape);
        Self {
            clearance: path.iter().map(clearance).fold(f64::INFINITY, f64::min) as f32,
            is_certified: certify_polyline(robot, scene, path).is_free(),
        }
    }
}
