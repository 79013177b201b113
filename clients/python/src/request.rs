//! Goals, obstacles and places from Python's own types.

use std::path::Path;

use pcc_model::Robot;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use shared_types::ipc::IpcOptions;
use shared_types::message::{Ball, MovingBall};
use shared_types::valid::Goal;

/// A goal: three numbers are a tip, metres in the base frame, six are a configuration, radians.
pub(crate) fn goal(numbers: &[f64]) -> PyResult<Goal> {
    if let Ok(tip) = <[f64; 3]>::try_from(numbers) {
        return Ok(Goal::tip(tip));
    }
    let configuration = <[f64; 6]>::try_from(numbers);
    configuration.map(Goal::Configuration).map_err(|_| {
        PyValueError::new_err(format!(
            "a goal has {} numbers; allowed are 3 (a tip, metres) and 6 (a configuration, radians)",
            numbers.len()
        ))
    })
}

/// Obstacles at rest: x, y, z and radius of each, metres.
pub(crate) fn balls(numbers: &[[f64; 4]]) -> Vec<Ball> {
    let ball = |&[x, y, z, radius_m]: &[f64; 4]| Ball {
        centre_m: [x, y, z],
        radius_m,
    };
    numbers.iter().map(ball).collect()
}

/// Obstacles that move: x, y, z and radius of each, metres, and its velocity, m/s.
pub(crate) fn moving_balls(numbers: &[[f64; 7]]) -> Vec<MovingBall> {
    let ball = |&[x, y, z, radius_m, vx, vy, vz]: &[f64; 7]| MovingBall {
        centre_m: [x, y, z],
        radius_m,
        velocity_m_s: [vx, vy, vz],
    };
    numbers.iter().map(ball).collect()
}

/// The robot of a robot file.
pub(crate) fn robot(file: &Path) -> PyResult<Robot> {
    Robot::from_file(file).map_err(|error| PyValueError::new_err(error.to_string()))
}

/// Where the services live: what is not given is `PCC_PREFIX` and `PCC_ROOT` of the environment, or the defaults.
pub(crate) fn options(prefix: Option<String>, root: Option<String>) -> IpcOptions {
    let from_env = IpcOptions::from_env();
    IpcOptions {
        prefix: prefix.unwrap_or(from_env.prefix),
        root: root.map_or(from_env.root, Into::into),
    }
}
