//! Plans.

use std::path::PathBuf;

use pyo3::prelude::*;
use shared_types::valid::{PlanRequest, PlannedExecution};

use crate::answer::Answer;
use crate::error::{duration, raised};
use crate::request::{balls, goal, options, robot};
use crate::waiting::wait;

/// A connection to the planner daemon that outlives the daemon's restarts.
#[pyclass(unsendable, module = "pcc")]
pub(crate) struct Client(::client::Client);

#[pymethods]
impl Client {
    #[new]
    #[pyo3(signature = (prefix=None, root=None, robot_file=None))]
    fn new(
        prefix: Option<String>,
        root: Option<String>,
        robot_file: Option<PathBuf>,
    ) -> PyResult<Self> {
        let client = ::client::Client::connect(&options(prefix, root));
        let mut client = client.map_err(raised)?;
        if let Some(file) = robot_file {
            client.state_robot(robot(&file)?.hash());
        }
        Ok(Self(client))
    }

    /// Plans to a goal (3 numbers: a tip, metres; 6: a configuration, radians), by way of others, among balls (x, y, z, radius), from
    /// where the robot is or from `start`, and has the fastest candidate executed where `execute` says so.
    #[pyo3(signature = (goal, *, via=vec![], start=None, balls=vec![], candidates=10, seed=0, execute=false, limits_scale=1.0, deadline=None, timeout=5.0))]
    #[allow(clippy::too_many_arguments)] // They have names in Python.
    fn plan(
        &mut self,
        py: Python<'_>,
        goal: Vec<f64>,
        via: Vec<Vec<f64>>,
        start: Option<[f64; 6]>,
        balls: Vec<[f64; 4]>,
        candidates: usize,
        seed: u64,
        execute: bool,
        limits_scale: f64,
        deadline: Option<f64>,
        timeout: f64,
    ) -> PyResult<Answer> {
        let goal = self::goal(&goal)?;
        let from = start.map_or_else(
            || PlanRequest::from_robot(goal),
            |start| PlanRequest::new(start, goal),
        );
        let request = PlanRequest {
            via: via
                .iter()
                .map(|goal| self::goal(goal))
                .collect::<PyResult<_>>()?,
            balls: self::balls(&balls),
            candidate_count: candidates,
            seed,
            execute,
            limits_scale,
            deadline: deadline
                .map(|deadline| duration("deadline", deadline))
                .transpose()?,
            ..from
        };
        wait(py, timeout, |limit| self.0.plan(&request, limit)).map(Answer::from)
    }

    /// Has a candidate of an earlier plan executed exactly as it was answered; the selected one where none is named.
    #[pyo3(signature = (plan_id, candidate=None, timeout=5.0))]
    fn execute(
        &mut self,
        py: Python<'_>,
        plan_id: u64,
        candidate: Option<usize>,
        timeout: f64,
    ) -> PyResult<Answer> {
        let execution = PlannedExecution::now(plan_id, candidate);
        wait(py, timeout, |limit| {
            self.0.execute_planned(&execution, limit)
        })
        .map(Answer::from)
    }
}
