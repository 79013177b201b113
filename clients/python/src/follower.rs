//! Following trajectories in the controller's place.

use ::client::ClientError;
use ::controller::service::{self, ControllerConfig};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use robot_driver::{TENDONS, TendonState, TendonVector};
use std::path::PathBuf;

use crate::driver::{Targets, motor_fault};
use crate::error::raised;
use crate::request::options;
use crate::waiting::detached;

/// Follows the planner's trajectories in the controller's place. As an iterator it gives each cycle, until it was shut down and the robot is at rest.
#[pyclass(unsendable, module = "pcc")]
pub(crate) struct Follower(service::Follower);

#[pymethods]
impl Follower {
    #[new]
    #[pyo3(signature = (config_file, position_m=[0.0; TENDONS], prefix=None, root=None))]
    fn new(
        config_file: PathBuf,
        position_m: TendonVector,
        prefix: Option<String>,
        root: Option<String>,
    ) -> PyResult<Self> {
        let config = ControllerConfig::from_file(&config_file);
        let config = config.map_err(|error| PyValueError::new_err(error.to_string()))?;
        let motors = TendonState {
            position_m,
            ..TendonState::default()
        };
        let follower = service::Follower::open(config, &options(prefix, root), &motors);
        let follower = follower.map_err(|error| raised(ClientError::from(error)))?;
        Ok(Self(follower))
    }

    fn __iter__(slf: PyRef<'_, Self>) -> PyRef<'_, Self> {
        slf
    }

    fn __next__(slf: &Bound<'_, Self>) -> PyResult<Option<Cycle>> {
        let py = slf.py();
        // Before it is borrowed: a handler may shut it down.
        py.check_signals()?;
        let follower = &mut *slf.try_borrow_mut()?;
        Ok(detached(py, || follower.0.next_cycle()).map(Cycle))
    }

    /// Says what the motors did in this cycle: the measured lengths of the tendons, and whether the motors are in fault.
    #[pyo3(signature = (measured_m, *, fault=false))]
    fn report(&mut self, measured_m: TendonVector, fault: bool) {
        self.0.report(&measured_m, motor_fault(fault));
    }

    /// Stops the robot along its path; the iterator then ends.
    fn shut_down(&self) {
        self.0.shut_down();
    }
}

/// One cycle of a follower: what the motors are to do, and the configuration that is commanded.
#[pyclass(frozen, module = "pcc")]
pub(crate) struct Cycle(service::FollowedCycle);

#[pymethods]
impl Cycle {
    #[getter]
    fn targets(&self) -> Targets {
        Targets(self.0.targets)
    }

    #[getter]
    fn configuration_rad(&self) -> [f64; 6] {
        self.0.commanded.position.into()
    }

    #[getter]
    fn velocity_rad_s(&self) -> [f64; 6] {
        self.0.commanded.velocity.into()
    }

    #[getter]
    fn acceleration_rad_s2(&self) -> [f64; 6] {
        self.0.commanded.acceleration.into()
    }

    #[getter]
    fn state(&self) -> String {
        self.0.state.to_string()
    }

    #[getter]
    fn trajectory_id(&self) -> u32 {
        self.0.trajectory_id
    }
}
