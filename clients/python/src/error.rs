//! The exception.

use std::time::Duration;

use ::client::ClientError;
use pyo3::create_exception;
use pyo3::exceptions::{PyException, PyValueError};
use pyo3::prelude::*;

create_exception!(
    pcc,
    PccError,
    PyException,
    "A call to planner, controller or robot that has failed, and why."
);

/// The exception for an error: a request that is not valid is a `ValueError`, everything else a `PccError`.
pub(crate) fn raised(error: ClientError) -> PyErr {
    match error {
        ClientError::InvalidRequest(_) => PyValueError::new_err(error.to_string()),
        _ => PccError::new_err(error.to_string()),
    }
}

/// The seconds that an argument says.
pub(crate) fn duration(name: &str, seconds: f64) -> PyResult<Duration> {
    let refused =
        |_| PyValueError::new_err(format!("{name} is {seconds}; allowed is finite, >= 0"));
    Duration::try_from_secs_f64(seconds).map_err(refused)
}
