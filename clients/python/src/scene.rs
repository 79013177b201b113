//! Publishing the obstacles that a source knows.

use ::client::ScenePublisher;
use pyo3::prelude::*;

use crate::error::{duration, raised};
use crate::request::{moving_balls, options};
use crate::waiting::{detached, wait};

/// Publishes what one source knows of the obstacles. As a context it takes its leave at the end, but not where an error ends it: the robot
/// then stops, as where the program dies.
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
    fn publish(&mut self, py: Python<'_>, balls: Vec<[f64; 7]>, lifetime: f64) -> PyResult<()> {
        let (balls, lifetime) = (moving_balls(&balls), duration("lifetime", lifetime)?);
        detached(py, || self.0.publish(&balls, lifetime)).map_err(raised)
    }

    /// Waits until the daemon has judged the last scene, which raises where it has refused it.
    #[pyo3(signature = (timeout=2.0))]
    fn confirm(&self, py: Python<'_>, timeout: f64) -> PyResult<()> {
        wait(py, timeout, |limit| self.0.confirm(limit))
    }

    /// Signs the source off: its obstacles are gone, and no scene of it is expected any more.
    fn leave(&mut self, py: Python<'_>) -> PyResult<()> {
        detached(py, || self.0.take_leave()).map_err(raised)
    }

    fn __enter__(slf: PyRef<'_, Self>) -> PyRef<'_, Self> {
        slf
    }

    fn __exit__(
        &mut self,
        py: Python<'_>,
        kind: &Bound<'_, PyAny>,
        _error: &Bound<'_, PyAny>,
        _traceback: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        if kind.is_none() {
            self.leave(py)
        } else {
            Ok(())
        }
    }
}
