//! How motions ended.

use ::client::ResultView;
use pyo3::prelude::*;

use crate::error::raised;
use crate::request::options;
use crate::waiting::wait;

/// The results of motions: those since it was made, and the last eight before.
#[pyclass(unsendable, module = "pcc")]
pub(crate) struct Results(ResultView);

#[pymethods]
impl Results {
    #[new]
    #[pyo3(signature = (prefix=None, root=None))]
    fn new(prefix: Option<String>, root: Option<String>) -> PyResult<Self> {
        ResultView::connect(&options(prefix, root))
            .map(Self)
            .map_err(raised)
    }

    /// Waits until a trajectory has ended: its outcome and the reason, or None where it has not in time.
    #[pyo3(signature = (trajectory_id, timeout=60.0))]
    fn wait(
        &mut self,
        py: Python<'_>,
        trajectory_id: u32,
        timeout: f64,
    ) -> PyResult<Option<(&'static str, String)>> {
        let ended = wait(py, timeout, |limit| self.0.wait_for(trajectory_id, limit))?;
        Ok(ended.map(|it| (it.outcome.text(), it.values.reason.to_string())))
    }
}
