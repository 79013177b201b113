//! Planners by name, with the models where they are needed.

use anyhow::{Context, bail};
use clap::{Args, ValueEnum};
use denoiser::{FastModel, Manifest, Precision, Solver, TemporalUnet};
use pcc_model::Robot;
use planning::{DiffusionModel, DiffusionSettings, Guidance, Models, Planner, Sampler};
use serde::Serialize;
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

/// Which diffusion model a planner has, and how it samples.
#[derive(Serialize)]
pub(crate) struct DiffusionRecord {
    model: String,
    /// Hash of the weights file.
    sha256: String,
    /// Updates of the training.
    updates: u64,
    /// Steps asked for.
    steps: usize,
    /// Evaluations of the network: fewer where two steps coincide.
    evaluations: usize,
    solver: String,
    precision: String,
}

/// A planner and what belongs in the record of its results.
pub(crate) struct Loaded {
    pub(crate) planner: Planner,
    /// Nothing for planners without a diffusion model.
    pub(crate) diffusion: Option<DiffusionRecord>,
}

/// Makes the planner, loading the weights that the sampler needs.
pub(crate) fn load(
    sampler: Sampler,
    robot: &Robot,
    arguments: &ModelArguments,
    threads: usize,
) -> anyhow::Result<Loaded> {
    let mut record = None;
    let mut models = Models::default();
    match sampler {
        Sampler::Default | Sampler::Fast => {
            let file = Manifest::open(&arguments.weights)?.weights(FAST_WEIGHTS)?;
            models.fast = Some(FastModel::from_weights(&file, robot.bending_limit)?);
        }
        Sampler::Diffusion(_) => {
            let (model, made) = load_diffusion(robot, arguments)?;
            (models.diffusion, record) = (Some(model), Some(made));
        }
        Sampler::Straight | Sampler::RrtConnect => {}
    }
    let planner = Planner::new(robot, models, threads).context("the planner could not be made")?;
    Ok(Loaded {
        planner,
        diffusion: record,
    })
}

fn load_diffusion(
    robot: &Robot,
    arguments: &ModelArguments,
) -> anyhow::Result<(DiffusionModel, DiffusionRecord)> {
    let settings = arguments.settings()?;
    let manifest = Manifest::open(&arguments.weights)?;
    let unet = TemporalUnet::load(&manifest.weights(&arguments.model)?, robot.bending_limit)?;
    let model = DiffusionModel::new(unet, settings)?;
    let entry = manifest.entry(&arguments.model)?;
    let record = DiffusionRecord {
        model: arguments.model.clone(),
        sha256: entry.sha256.clone(),
        updates: entry.updates,
        steps: settings.steps,
        evaluations: model.evaluations(),
        solver: name_of(&arguments.solver),
        precision: name_of(&arguments.precision),
    };
    Ok((model, record))
}

/// The name of a choice on the command line.
pub(crate) fn name_of(choice: &impl ValueEnum) -> String {
    let value = choice.to_possible_value();
    value.map_or_else(String::new, |v| v.get_name().to_owned())
}
