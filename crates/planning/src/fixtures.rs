//! A robot and a search for unit tests.

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
