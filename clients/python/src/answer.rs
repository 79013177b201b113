//! Answers, and views of their knots in the daemon's own memory.

use std::ffi::{CStr, c_int, c_void};
use std::ptr::null_mut;

use ::client::PlanAnswer;
use pyo3::exceptions::{PyBufferError, PyIndexError};
use pyo3::ffi;
use pyo3::prelude::*;
use shared_types::codes::{Outcome, Source};
use shared_types::message::{CandidateSummary, Knot};

/// Numbers of a knot: time, configuration, velocity, acceleration.
const NUMBERS: usize = size_of::<Knot>() / size_of::<f64>();
const FORMAT: &CStr = c"d";

/// An answer. Its memory is given back to the daemon with the last reference to it, to a candidate of it, or to an array of knots.
#[pyclass(unsendable, module = "pcc")]
pub(crate) struct Answer(PlanAnswer);

/// One certified motion of an answer.
#[pyclass(unsendable, module = "pcc")]
pub(crate) struct Candidate {
    answer: Py<Answer>,
    index: usize,
    shape: [ffi::Py_ssize_t; 2],
    strides: [ffi::Py_ssize_t; 2],
}

impl From<PlanAnswer> for Answer {
    fn from(answer: PlanAnswer) -> Self {
        Self(answer)
    }
}

#[pymethods]
impl Answer {
    #[getter]
    fn outcome(&self) -> &'static str {
        self.0.report().outcome.text()
    }

    #[getter]
    fn is_ok(&self) -> bool {
        self.0.report().outcome == Outcome::Ok
    }

    #[getter]
    fn reason(&self) -> String {
        self.0.report().reason.clone()
    }

    #[getter]
    fn plan_id(&self) -> u64 {
        self.0.report().plan_id
    }

    #[getter]
    fn plan_hash(&self) -> u64 {
        self.0.report().plan_hash
    }

    #[getter]
    fn trajectory_id(&self) -> Option<u32> {
        self.0.report().trajectory_id
    }

    #[getter]
    fn selected(&self) -> Option<usize> {
        self.0.report().selected
    }

    #[getter]
    fn stages_ns(&self) -> Vec<u64> {
        self.0.report().stages_ns.to_vec()
    }

    fn __len__(&self) -> usize {
        self.0.report().candidates.len()
    }

    fn __getitem__(slf: Bound<'_, Self>, index: usize) -> PyResult<Candidate> {
        let knots = slf.borrow().0.candidate(index).map(|it| it.knots.len());
        let knots = knots.ok_or_else(|| PyIndexError::new_err("there is no such candidate"))?;
        Ok(Candidate {
            answer: slf.unbind(),
            index,
            shape: [knots as ffi::Py_ssize_t, NUMBERS as ffi::Py_ssize_t],
            strides: [
                size_of::<Knot>() as ffi::Py_ssize_t,
                size_of::<f64>() as ffi::Py_ssize_t,
            ],
        })
    }

    fn __repr__(&self) -> String {
        let report = self.0.report();
        let count = report.candidates.len();
        format!(
            "<pcc.Answer: {}, {count} candidates, hash {:016x}>",
            report.outcome, report.plan_hash
        )
    }
}

impl Candidate {
    fn summary(&self, py: Python<'_>) -> CandidateSummary {
        self.answer.borrow(py).0.report().candidates[self.index]
    }
}

#[pymethods]
impl Candidate {
    #[getter]
    fn duration_s(&self, py: Python<'_>) -> f64 {
        self.summary(py).duration_s
    }

    #[getter]
    fn tip_path_m(&self, py: Python<'_>) -> f64 {
        self.summary(py).tip_path_m
    }

    #[getter]
    fn clearance_m(&self, py: Python<'_>) -> f64 {
        self.summary(py).clearance_m
    }

    #[getter]
    fn tip_error_m(&self, py: Python<'_>) -> f64 {
        self.summary(py).tip_error_m
    }

    #[getter]
    fn source(&self, py: Python<'_>) -> &'static str {
        Source::try_from(self.summary(py).source).map_or("", Source::text)
    }

    /// The knots as a NumPy array that cannot be written to, in the daemon's own memory: a row for each knot, of its time (s), configuration
    /// (6, rad), velocity (6, rad/s) and acceleration (6, rad/s²).
    #[getter]
    fn knots<'py>(slf: Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("numpy")?.call_method1("asarray", (slf,))
    }

    /// The knots by the buffer protocol.
    unsafe fn __getbuffer__(
        slf: Bound<'_, Self>,
        view: *mut ffi::Py_buffer,
        flags: c_int,
    ) -> PyResult<()> {
        if view.is_null() {
            return Err(PyBufferError::new_err("there is no view to fill"));
        }
        if flags & ffi::PyBUF_WRITABLE == ffi::PyBUF_WRITABLE {
            return Err(PyBufferError::new_err(
                "the daemon's memory cannot be written to",
            ));
        }
        let candidate = slf.borrow();
        let answer = candidate.answer.borrow(slf.py());
        let found = answer.0.candidate(candidate.index);
        let knots = found
            .ok_or_else(|| PyBufferError::new_err("there is no such candidate"))?
            .knots;
        let asks_for = |flag: c_int| flags & flag == flag;
        // SAFETY: Python gives a view to be filled. The knots stay where they are while the answer lives, which the candidate keeps, which
        // the view keeps.
        unsafe {
            (*view).buf = knots.as_ptr().cast::<c_void>().cast_mut();
            (*view).len = size_of_val(knots) as ffi::Py_ssize_t;
            (*view).readonly = 1;
            (*view).itemsize = size_of::<f64>() as ffi::Py_ssize_t;
            (*view).format = if asks_for(ffi::PyBUF_FORMAT) {
                FORMAT.as_ptr().cast_mut()
            } else {
                null_mut()
            };
            (*view).ndim = 2;
            (*view).shape = candidate.shape.as_ptr().cast_mut();
            (*view).strides = if asks_for(ffi::PyBUF_STRIDES) {
                candidate.strides.as_ptr().cast_mut()
            } else {
                null_mut()
            };
            (*view).suboffsets = null_mut();
            (*view).internal = null_mut();
            (*view).obj = slf.clone().into_ptr();
        }
        Ok(())
    }
}
