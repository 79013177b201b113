//! A robot, a search and what motions must keep, for unit tests.

use crate::motion::constraints::MotionConstraints;
use crate::motion::path_to_trajectory::MOST_CORRECTIONS;
use crate::moving_obstacles;
use crate::optimize::smooth_update::PushKernel;
use crate::optimize::tip_path::TipPaths;
use crate::problem::BENDING_SLACK_RAD;
use crate::search::edges::{RrtSettings, Search};
use collision::Scene;
use pcc_model::{Robot, UnitRobot};
use std::path::Path;

/// The paper's unit robot.
pub(crate) fn unit_robot() -> UnitRobot {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../config/robots/unit.toml");
    Robot::from_file(Path::new(file))
        .unwrap()
        .to_unit()
        .unwrap()
}

/// What a motion of this robot must keep beside obstacles that rest; it may bend as far as one from rest through several goals.
pub(crate) fn constraints<'a>(
    robot: &'a UnitRobot,
    scene: &'a Scene,
    kernel: &'a PushKernel,
    tip_paths: &'a TipPaths,
) -> MotionConstraints<'a> {
    MotionConstraints {
        robot,
        padded: robot,
        scene,
        moving: &moving_obstacles::NONE,
        kernel,
        tip_paths,
        limits: robot.tendon_limits,
        knots: 96,
        bending_slack_rad: BENDING_SLACK_RAD,
        corrections: MOST_CORRECTIONS,
        interrupt: &|| false,
    }
}

/// A search that nobody interrupts.
pub(crate) fn search<'a>(
    robot: &'a UnitRobot,
    scene: &'a Scene,
    settings: &'a RrtSettings,
) -> Search<'a> {
    Search {
        robot,
        scene,
        settings,
        interrupt: &|| false,
    }
}
