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
    /// Solver of the diffusion planners: `ddim`, the paper's, which it is without this, or `dpm-solver` (DPM-Solver++(2M)).
    #[arg(long)]
    solver: Option<Solver>,
    /// Arithmetic of the diffusion planners' network: `f32`, which it is without this, or `bf16` where the processor has
    /// products of 16 bits.
    #[arg(long)]
    precision: Option<Precision>,
}

impl ModelArguments {
    fn settings(&self) -> anyhow::Result<DiffusionSettings> {
        let steps = self.steps.unwrap_or(STEPS);
        if !(1..=1000).contains(&steps) {
            bail!("--steps {steps}: 1 to 1000 are allowed");
        }
        Ok(DiffusionSettings {
            solver: self.solver.unwrap_or(Solver::Ddim),
            steps,
            precision: self.precision.unwrap_or(Precision::Single),
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
        solver: settings.solver.to_string(),
        precision: settings.precision.to_string(),
    };
    Ok((model, record))
}

/// The name of a choice on the command line.
pub(crate) fn name_of(choice: &impl ValueEnum) -> String {
    let value = choice.to_possible_value();
    value.map_or_else(String::new, |v| v.get_name().to_owned())
}
