//! Planners by name, with the model where one is needed.

use anyhow::Context;
use clap::ValueEnum;
use denoiser::{FastModel, Manifest};
use pcc_model::Robot;
use planning::{Planner, Sampler};
use std::path::Path;

/// Weights that `fast` and `default` use.
const FAST_WEIGHTS: &str = "fast";

/// A planner as `pcc evaluate --planner` names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum PlannerName {
    /// What the daemon serves: learned candidates, filled by classical ones.
    Default,
    /// The learned few-step sampler alone.
    Fast,
    /// The null arm: straight segments, the same correction and certificate.
    Straight,
    /// RRT-Connect on certified edges.
    RrtConnect,
}

impl PlannerName {
    pub(crate) fn sampler(self) -> Sampler {
        match self {
            Self::Default => Sampler::Default,
            Self::Fast => Sampler::Fast,
            Self::Straight => Sampler::Straight,
            Self::RrtConnect => Sampler::RrtConnect,
        }
    }
}

/// Makes the planner, loading weights from the folder if the name needs them.
pub(crate) fn load(
    name: PlannerName,
    robot: &Robot,
    weights: &Path,
    threads: usize,
) -> anyhow::Result<Planner> {
    let model = match name {
        PlannerName::Default | PlannerName::Fast => Some(load_model(robot, weights)?),
        PlannerName::Straight | PlannerName::RrtConnect => None,
    };
    Planner::new(robot, model, threads).context("the planner could not be made")
}

fn load_model(robot: &Robot, weights: &Path) -> anyhow::Result<FastModel> {
    let manifest = Manifest::open(weights)?;
    let file = manifest.weights(FAST_WEIGHTS)?;
    Ok(FastModel::from_weights(&file, robot.bending_limit)?)
}
