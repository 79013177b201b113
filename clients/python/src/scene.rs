//! Publishing the obstacles that a source knows.

use ::client::ScenePublisher;
use pyo3::prelude::*;

use crate::error::{raised, time_limit};
use crate::request::{moving_balls, options};

/// Publishes what one source knows of the obstacles. As a context it takes its leave at the end.
#[pyclass(unsendable, module = "pcc")]
pub(crate) struct Scene(ScenePublisher);

#[pymethods]
impl Scene {
    #[new]
    #[pyo3(signature = (source, prefix=None, root=None))]
    fn new(source: &str, prefix: Option<String>, root: Option<String>) -> PyResult<Self> {
        let scene = ScenePublisher::connect(&options(prefix, root), source);
        scene.map(Self).map_err(raised)
    }

    /// Publishes all balls that the source knows of now (x, y, z, radius, metres; vx, vy, vz, m/s); they count for `lifetime` seconds.
    fn publish(&mut self, balls: Vec<[f64; 7]>, lifetime: f64) -> PyResult<()> {
        let lifetime = time_limit(lifetime)?;
        self.0
            .publish(&moving_balls(&balls), lifetime)
            .map_err(raised)
    }

    /// Waits until the daemon has judged the last scene, which raises where it has refused it.
    #[pyo3(signature = (timeout=2.0))]
    fn confirm(&self, timeout: f64) -> PyResult<()> {
        self.0.confirm(time_limit(timeout)?).map_err(raised)
    }

    /// Signs the source off: its obstacles are gone, and no scene of it is expected any more.
    fn leave(&mut self) -> PyResult<()> {
        self.0.take_leave().map_err(raised)
    }

    fn __enter__(slf: PyRef<'_, Self>) -> PyRef<'_, Self> {
        slf
    }

    fn __exit__(
        &mut self,
        _kind: &Bound<'_, PyAny>,
        _error: &Bound<'_, PyAny>,
        _traceback: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        self.leave()
    }
}
