//! Driving a robot's motors.

use ::client::ClientError;
use pyo3::prelude::*;
use robot_driver::{
    DriverSettings, MotorTargets, RobotConnection, RobotDriver, TENDONS, TendonState, TendonVector,
};
use shared_types::codes::MotorFault;
use std::path::PathBuf;

use crate::error::raised;
use crate::request::{options, robot};
use crate::waiting::detached;

/// Drives the motors of a robot, in cycles of 1 ms; it has the robot's place. As an iterator it gives what the motors are to do in each
/// cycle, until it was shut down and they rest.
#[pyclass(unsendable, module = "pcc")]
pub(crate) struct Driver(RobotDriver);

#[pymethods]
impl Driver {
    #[new]
    #[pyo3(signature = (robot_file, position_m=[0.0; TENDONS], prefix=None, root=None))]
    fn new(
        robot_file: PathBuf,
        position_m: TendonVector,
        prefix: Option<String>,
        root: Option<String>,
    ) -> PyResult<Self> {
        let robot = robot(&robot_file)?;
        let settings = DriverSettings::of(&robot);
        let connection = RobotConnection::open(&options(prefix, root), &robot, &settings);
        let state = TendonState {
            position_m,
            ..TendonState::default()
        };
        let connection = connection.map_err(|error| raised(ClientError::from(error)))?;
        Ok(Self(connection.drive_from(&state)))
    }

    fn __iter__(slf: PyRef<'_, Self>) -> PyRef<'_, Self> {
        slf
    }

    fn __next__(slf: &Bound<'_, Self>) -> PyResult<Option<Targets>> {
        let py = slf.py();
        // Before it is borrowed: a handler may shut it down.
        py.check_signals()?;
        let driver = &mut *slf.try_borrow_mut()?;
        Ok(detached(py, || driver.0.next_targets()).map(Targets))
    }

    /// Publishes what the motors did in this cycle: the measured lengths of the tendons, and whether the motors are in fault.
    #[pyo3(signature = (measured_m, *, fault=false))]
    fn report(&mut self, measured_m: TendonVector, fault: bool) {
        self.0.report(&measured_m, motor_fault(fault));
    }

    /// Ramps the motors to rest; the iterator then ends.
    fn shut_down(&self) {
        self.0.shut_down();
    }
}

pub(crate) fn motor_fault(is_in_fault: bool) -> MotorFault {
    match is_in_fault {
        true => MotorFault::Motor,
        false => MotorFault::None,
    }
}

/// What motors are to do in a cycle.
#[pyclass(frozen, module = "pcc")]
pub(crate) struct Targets(pub(crate) MotorTargets);

#[pymethods]
impl Targets {
    #[getter]
    fn stamp_ns(&self) -> i64 {
        self.0.stamp_ns
    }

    #[getter]
    fn position_m(&self) -> TendonVector {
        self.0.position_m
    }

    #[getter]
    fn velocity_m_s(&self) -> TendonVector {
        self.0.velocity_m_s
    }

    #[getter]
    fn acceleration_m_s2(&self) -> TendonVector {
        self.0.acceleration_m_s2
    }
}
