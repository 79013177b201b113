//! Planners by name, with the models where they are needed.

use anyhow::{Context, bail};
use clap::{Args, ValueEnum};
use denoiser::{FastModel, Manifest, Precision, Solver, TemporalUnet};
use pcc_model::Robot;
use planning::{DiffusionModel, DiffusionSettings, Guidance, Models, Planner, Sampler};
use std::path::PathBuf;

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
    /// The paper's diffusion model.
    Diffusion,
    /// The same with post correction in its last steps.
    DiffusionPost,
    /// The same with guided prediction in its last steps.
    DiffusionGuided,
}

impl PlannerName {
    pub(crate) fn sampler(self) -> Sampler {
        match self {
            Self::Default => Sampler::Default,
            Self::Fast => Sampler::Fast,
            Self::Straight => Sampler::Straight,
            Self::RrtConnect => Sampler::RrtConnect,
            Self::Diffusion => Sampler::Diffusion(Guidance::Pure),
            Self::DiffusionPost => Sampler::Diffusion(Guidance::Post),
            Self::DiffusionGuided => Sampler::Diffusion(Guidance::Guided),
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum SolverName {
    /// Deterministic DDIM, the paper's.
    Ddim,
    /// DPM-Solver++(2M).
    DpmSolver,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum PrecisionName {
    /// 32 bits.
    F32,
    /// 16 bits where the processor has products for them, sums of 32 bits.
    Bf16,
}

/// Which weights are used, and how the diffusion model is sampled.
#[derive(Args)]
pub(crate) struct ModelArguments {
    /// Folder of the weights and their manifest.
    #[arg(long, default_value = "weights")]
    pub(crate) weights: PathBuf,
    /// Weights of the diffusion planners, by their name in the manifest.
    #[arg(long, default_value = "mixed")]
    pub(crate) model: String,
    /// Evaluations of the diffusion planners' network (1 to 1000).
    #[arg(long, default_value_t = 50)]
    pub(crate) steps: usize,
    /// Solver of the diffusion planners.
    #[arg(long, value_enum, default_value = "ddim")]
    solver: SolverName,
    /// Arithmetic of the diffusion planners' network.
    #[arg(long, value_enum, default_value = "f32")]
    precision: PrecisionName,
}

impl ModelArguments {
    fn settings(&self) -> anyhow::Result<DiffusionSettings> {
        if !(1..=1000).contains(&self.steps) {
            bail!("--steps {}: 1 to 1000 are allowed", self.steps);
        }
        let precision = match self.precision {
            PrecisionName::F32 => Precision::Single,
            PrecisionName::Bf16 => Precision::Brain,
        };
        let solver = match self.solver {
            SolverName::Ddim => Solver::Ddim,
            SolverName::DpmSolver => Solver::DpmSolver,
        };
        Ok(DiffusionSettings {
            solver,
            steps: self.steps,
            precision,
        })
    }
}

/// Makes the planner, loading the weights that the sampler needs.
pub(crate) fn load(
    sampler: Sampler,
    robot: &Robot,
    arguments: &ModelArguments,
    threads: usize,
) -> anyhow::Result<Planner> {
    let mut models = Models::default();
    match sampler {
        Sampler::Default | Sampler::Fast => {
            let file = Manifest::open(&arguments.weights)?.weights(FAST_WEIGHTS)?;
            models.fast = Some(FastModel::from_weights(&file, robot.bending_limit)?);
        }
        Sampler::Diffusion(_) => {
            let settings = arguments.settings()?;
            let file = Manifest::open(&arguments.weights)?.weights(&arguments.model)?;
            let unet = TemporalUnet::load(&file, robot.bending_limit)?;
            models.diffusion = Some(DiffusionModel::new(unet, settings)?);
        }
        Sampler::Straight | Sampler::RrtConnect => {}
    }
    Planner::new(robot, models, threads).context("the planner could not be made")
}
