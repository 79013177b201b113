//! Robot files of commands that compute without the daemon.

use anyhow::Context;
use pcc_model::{Robot, UnitRobot};
use std::path::Path;

/// Loads a robot in units of its section length.
pub(crate) fn unit_robot(file: &Path) -> anyhow::Result<UnitRobot> {
    let robot = Robot::from_file(file)?;
    robot.to_unit().with_context(|| {
        let lengths = robot.section_lengths;
        format!(
            "robot file {}: section_lengths_m = {lengths:?}: the three sections must be equally long",
            file.display()
        )
    })
}
