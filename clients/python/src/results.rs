//! How motions ended.

use std::time::{Duration, Instant};

use ::client::ResultView;
use pyo3::prelude::*;

use crate::error::{raised, time_limit};
use crate::request::options;

/// Time after which a wait lets Python look for signals.
const SLICE: Duration = Duration::from_millis(50);

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
        let end = Instant::now() + time_limit(timeout)?;
        loop {
            let left = end.saturating_duration_since(Instant::now());
            let ended = self
                .0
                .wait_for(trajectory_id, left.min(SLICE))
                .map_err(raised)?;
            if ended.is_some() || left.is_zero() {
                return Ok(ended.map(|it| (it.outcome.text(), it.values.reason.to_string())));
            }
            py.check_signals()?;
        }
    }
}
