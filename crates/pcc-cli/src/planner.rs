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
/// Weights of the diffusion planners where none are named.
const DIFFUSION_WEIGHTS: &str = "mixed";
/// The paper's steps.
const STEPS: usize = 50;

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
    /// Weights of the diffusion planners, by their name in the manifest; without it `mixed`.
    #[arg(long)]
    model: Option<String>,
    /// Evaluations of the diffusion planners' network (1 to 1000); without it the paper's 50.
    #[arg(long)]
    steps: Option<usize>,
    /// Solver of the diffusion planners; without it the paper's `ddim`.
    #[arg(long, value_enum)]
    solver: Option<SolverName>,
    /// Arithmetic of the diffusion planners' network; without it `f32`.
    #[arg(long, value_enum)]
    precision: Option<PrecisionName>,
}

impl ModelArguments {
    fn settings(&self) -> anyhow::Result<DiffusionSettings> {
        let steps = self.steps.unwrap_or(STEPS);
        if !(1..=1000).contains(&steps) {
            bail!("--steps {steps}: 1 to 1000 are allowed");
        }
        let precision = match self.precision {
            None | Some(PrecisionName::F32) => Precision::Single,
            Some(PrecisionName::Bf16) => Precision::Brain,
        };
        let solver = match self.solver {
            None | Some(SolverName::Ddim) => Solver::Ddim,
            Some(SolverName::DpmSolver) => Solver::DpmSolver,
        };
        Ok(DiffusionSettings {
            solver,
            steps,
            precision,
        })
    }

    /// Refuses what a planner without a diffusion model would not read.
    fn refuse_diffusion_options(&self, planner: PlannerName) -> anyhow::Result<()> {
        let given = [
            ("--model", self.model.is_some()),
            ("--steps", self.steps.is_some()),
            ("--solver", self.solver.is_some()),
            ("--precision", self.precision.is_some()),
        ];
        match given.iter().find(|(_, is_given)| *is_given) {
            Some((option, _)) => bail!(
                "{option} is not read by --planner {}: it goes with diffusion, diffusion-post and diffusion-guided",
                name_of(&planner)
            ),
            None => Ok(()),
        }
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
    name: PlannerName,
    robot: &Robot,
    arguments: &ModelArguments,
    threads: usize,
) -> anyhow::Result<Loaded> {
    let sampler = name.sampler();
    if !matches!(sampler, Sampler::Diffusion(_)) {
        arguments.refuse_diffusion_options(name)?;
    }
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
    let name = arguments.model.as_deref().unwrap_or(DIFFUSION_WEIGHTS);
    let unet = TemporalUnet::load(&manifest.weights(name)?, robot.bending_limit)?;
    let model = DiffusionModel::new(unet, settings)?;
    let entry = manifest.entry(name)?;
    let record = DiffusionRecord {
        model: name.to_owned(),
        sha256: entry.sha256.clone(),
        updates: entry.updates,
        steps: settings.steps,
        evaluations: model.evaluations(),
        solver: name_of(&arguments.solver.unwrap_or(SolverName::Ddim)),
        precision: name_of(&arguments.precision.unwrap_or(PrecisionName::F32)),
    };
    Ok((model, record))
}

/// The name of a choice on the command line.
pub(crate) fn name_of(choice: &impl ValueEnum) -> String {
    let value = choice.to_possible_value();
    value.map_or_else(String::new, |v| v.get_name().to_owned())
}
