//! A planner with the weights that are shipped.

use denoiser::{FastModel, Manifest};
use pcc_model::Robot;
use planning::{Models, Planner};
use std::path::Path;

/// For the unit robot, with so many workers.
pub(crate) fn planner(threads: usize) -> Planner {
    let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
    let robot = Robot::from_file(&root.join("config/robots/unit.toml")).unwrap();
    let robot = robot.to_unit().unwrap();
    let file = Manifest::open(&root.join("weights"))
        .unwrap()
        .weights("fast");
    let models = Models {
        fast: Some(FastModel::from_weights(&file.unwrap(), robot.bending_limit).unwrap()),
        ..Models::default()
    };
    Planner::new(robot, models, threads).unwrap()
}
