//! What several unit tests need.

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
