//! Robots of commands that compute by themselves.

use anyhow::Context;
use pcc_model::Robot;
use std::path::Path;

/// Loads a robot in units of its section length.
pub(crate) fn unit_robot(file: &Path) -> anyhow::Result<Robot> {
    let robot = Robot::from_file(file)?;
    let length = robot.equal_section_length().with_context(|| {
        let lengths = robot.section_lengths;
        format!(
            "robot file {}: section_lengths_m = {lengths:?}: the three sections must be equally long",
            file.display()
        )
    })?;
    Ok(robot.scaled(1.0 / length))
}
