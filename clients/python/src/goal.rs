//! A goal that the daemon keeps the robot on its way to.

use std::path::PathBuf;

use ::client::GoalSender;
use pyo3::prelude::*;

use crate::error::raised;
use crate::request::{goal, options, robot};

/// Gives the daemon a goal that stays, moves it, and hears what becomes of it.
#[pyclass(unsendable, module = "pcc")]
pub(crate) struct Goal(GoalSender);

#[pymethods]
impl Goal {
    #[new]
    #[pyo3(signature = (prefix=None, root=None, robot_file=None))]
    fn new(
        prefix: Option<String>,
        root: Option<String>,
        robot_file: Option<PathBuf>,
    ) -> PyResult<Self> {
        let mut sender = GoalSender::connect(&options(prefix, root)).map_err(raised)?;
        if let Some(file) = robot_file {
            sender.state_robot(robot(&file)?.hash());
        }
        Ok(Self(sender))
    }

    /// Gives another goal; it takes the place of every earlier one.
    #[pyo3(signature = (goal, limits_scale=1.0))]
    fn give(&mut self, goal: Vec<f64>, limits_scale: f64) -> PyResult<()> {
        self.0
            .give(self::goal(&goal)?, limits_scale)
            .map_err(raised)
    }

    /// Says where the goal is now, and with which velocity it moves where it is a tip, m/s.
    #[pyo3(signature = (goal, velocity=[0.0; 3]))]
    fn move_to(&mut self, goal: Vec<f64>, velocity: [f64; 3]) -> PyResult<()> {
        self.0.move_to(self::goal(&goal)?, velocity).map_err(raised)
    }

    /// Gives the goal up: the robot brakes along its path.
    fn withdraw(&mut self) -> PyResult<()> {
        self.0.withdraw().map_err(raised)
    }

    /// What becomes of the goal that was given last, and why; None until the daemon has heard it, and
    /// again once that daemon has ended before the goal.
    fn status(&mut self) -> PyResult<Option<(&'static str, String)>> {
        let status = self.0.status().map_err(raised)?;
        Ok(status.map(|status| (status.state.text(), status.values.reason.to_string())))
    }
}
