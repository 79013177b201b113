//! The controller's state, and orders to it.

use ::client::ControllerView;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use shared_types::valid::Command;

use crate::error::raised;
use crate::request::options;
use crate::waiting::wait;

/// The controller's state, and orders to it.
#[pyclass(unsendable, module = "pcc")]
pub(crate) struct Controller(ControllerView);

#[pymethods]
impl Controller {
    #[new]
    #[pyo3(signature = (prefix=None, root=None))]
    fn new(prefix: Option<String>, root: Option<String>) -> PyResult<Self> {
        ControllerView::connect(&options(prefix, root))
            .map(Self)
            .map_err(raised)
    }

    /// The newest state, however old; None where the controller has published none.
    fn state<'py>(&mut self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let Some(state) = self.0.latest_state().map_err(raised)? else {
            return Ok(None);
        };
        let values = &state.values;
        let told = PyDict::new(py);
        told.set_item("state", state.state.text())?;
        told.set_item("fault", state.fault.text())?;
        told.set_item("waiting", state.waiting.text())?;
        told.set_item("stamp_mono_ns", values.stamp_mono_ns)?;
        told.set_item("trajectory_id", values.trajectory_id)?;
        told.set_item("trajectory_time_s", values.trajectory_time_s)?;
        told.set_item("speed", values.speed)?;
        told.set_item("rate", values.rate)?;
        told.set_item("tracking_error_rad", values.tracking_error_rad)?;
        told.set_item(
            "commanded_configuration_rad",
            values.commanded_configuration_rad,
        )?;
        told.set_item(
            "measured_configuration_rad",
            values.measured_configuration_rad,
        )?;
        Ok(Some(told))
    }

    /// Gives an order ("stop", "reset", "pause", "resume", "speed" with the speed to run at), and waits for the reply: whether it takes
    /// effect, and the controller's words.
    #[pyo3(signature = (order, speed=None, *, reason="", timeout=2.0))]
    fn command(
        &mut self,
        py: Python<'_>,
        order: &str,
        speed: Option<f64>,
        reason: &str,
        timeout: f64,
    ) -> PyResult<(bool, String)> {
        let command = match (order, speed) {
            ("stop", None) => Command::Stop,
            ("reset", None) => Command::ResetFault,
            ("pause", None) => Command::Pause,
            ("resume", None) => Command::Resume,
            ("speed", Some(speed)) => Command::SetSpeed(speed),
            _ => {
                return Err(PyValueError::new_err(format!(
                    "{order:?} with speed {speed:?}; allowed are stop, reset, pause, resume, and speed with a speed"
                )));
            }
        };
        let command = command.because(reason);
        let reply = wait(py, timeout, |limit| self.0.command(command, limit))?;
        Ok((reply.accepted, reply.reason.to_string()))
    }
}
