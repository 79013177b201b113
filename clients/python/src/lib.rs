//! The client for Python, over the crate `client`: the module `pcc`, typed in `pcc.pyi`.
#![allow(unsafe_code)] // The buffer protocol, and waits without Python's lock.
#![allow(clippy::needless_pass_by_value)] // Python hands values over.

mod answer;
mod client;
mod controller;
mod driver;
mod error;
mod follower;
mod goal;
mod request;
mod results;
mod scene;
mod waiting;

use pyo3::prelude::*;

/// The client of the planner, its controller and the robot.
#[pymodule]
fn pcc(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("PccError", module.py().get_type::<error::PccError>())?;
    module.add_class::<answer::Answer>()?;
    module.add_class::<answer::Candidate>()?;
    module.add_class::<client::Client>()?;
    module.add_class::<controller::Controller>()?;
    module.add_class::<driver::Driver>()?;
    module.add_class::<driver::Targets>()?;
    module.add_class::<follower::Cycle>()?;
    module.add_class::<follower::Follower>()?;
    module.add_class::<goal::Goal>()?;
    module.add_class::<results::Results>()?;
    module.add_class::<scene::Scene>()?;
    Ok(())
}
