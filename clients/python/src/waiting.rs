//! Waits during which other Python threads run, and which Ctrl-C ends.

use std::cell::RefCell;

use ::client::{ClientError, TimeLimit};
use pyo3::prelude::*;

use crate::error::{duration, raised};

/// A value that stays in its thread.
struct OfThisThread<T>(T);

// SAFETY: `detached` alone makes one, and `Python::detach` calls its closure in the thread that it is called in: nothing goes to another.
unsafe impl<T> Send for OfThisThread<T> {}

impl<T> OfThisThread<T> {
    fn into_inner(self) -> T {
        self.0
    }
}

/// Calls something that reaches nothing of Python's without Python's lock, so that other Python threads run meanwhile.
pub(crate) fn detached<T>(py: Python<'_>, call: impl FnOnce() -> T) -> T {
    let call = OfThisThread(call);
    py.detach(move || OfThisThread(call.into_inner()()))
        .into_inner()
}

/// Waits without Python's lock, at most for `timeout` seconds; what a signal raises, as Ctrl-C does, ends the wait.
pub(crate) fn wait<T>(
    py: Python<'_>,
    timeout: f64,
    wait: impl FnOnce(TimeLimit<'_>) -> Result<T, ClientError>,
) -> PyResult<T> {
    let limit = TimeLimit::new(duration("timeout", timeout)?);
    let raised_by_signal = RefCell::new(None);
    let is_given_up = || {
        let error = Python::attach(|py| py.check_signals().err());
        *raised_by_signal.borrow_mut() = error;
        raised_by_signal.borrow().is_some()
    };
    let waited = detached(py, || wait(limit.unless(&is_given_up)));
    match raised_by_signal.take() {
        Some(error) => Err(error),
        None => waited.map_err(raised),
    }
}
