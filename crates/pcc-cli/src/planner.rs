//! The options that name a planner's models, and the planner made with them.

use crate::number::whole;
use crate::sampler::{PlannerName, choice, name_of};
use anyhow::{Context, bail};
use clap::Args;
use denoiser::{FastModel, Manifest, Precision, Solver, TemporalUnet, WeightsFile};
use pcc_model::UnitRobot;
use planning::{DiffusionModel, DiffusionSettings, Guidance, Models, Planner, Sampler};
use serde::Serialize;
use std::error::Error;
use std::path::PathBuf;

/// Weights that `fast` and `default` use where none are named.
const FAST_WEIGHTS: &str = "fast";
/// Weights of the diffusion planners where none are named.
const DIFFUSION_WEIGHTS: &str = "mixed";
/// The paper's steps.
const STEPS: usize = 50;

/// Most evaluations of a diffusion planner's network: the noise levels that it was trained with.
const MOST_STEPS: usize = 1000;
/// Longest name of weights, bytes.
const LONGEST_NAME: usize = 64;

fn model_name(text: &str) -> Result<String, String> {
    let is_name = (1..=LONGEST_NAME).contains(&text.len());
    is_name
        .then(|| text.to_owned())
        .ok_or_else(|| format!("a name of 1 to {LONGEST_NAME} bytes is needed"))
}

/// Which weights are used, and how the diffusion model is sampled.
#[derive(Args, Clone)]
pub(crate) struct ModelArguments {
    /// Folder of the weights and their manifest.
    #[arg(long, default_value = "weights")]
    pub(crate) weights: PathBuf,
    /// Weights by their name in the manifest; without it `fast` for the planners `fast` and `default`, `mixed` for those by
    /// diffusion.
    #[arg(long, value_parser = model_name)]
    model: Option<String>,
    /// Evaluations of the network by `fast` and `default` (1, 2, 4 or 8); without it as many as the weights say.
    #[arg(long, value_parser = choice([("1", 1_usize), ("2", 2), ("4", 4), ("8", 8)]))]
    evaluations: Option<usize>,
    /// Evaluations of the diffusion planners' network (1 to 1000); without it the paper's 50.
    #[arg(long, value_parser = whole(1, MOST_STEPS))]
    steps: Option<usize>,
    /// Solver of the diffusion planners: `ddim`, the paper's, which it is without this, or `dpm-solver` (DPM-Solver++(2M)).
    #[arg(long, value_parser = choice([("ddim", Solver::Ddim), ("dpm-solver", Solver::DpmSolver)]))]
    solver: Option<Solver>,
    /// Arithmetic of the diffusion planners' network: `f32`, which it is without this, or `bf16` where the processor has
    /// products of 16 bits.
    #[arg(long, value_parser = choice([("f32", Precision::F32), ("bf16", Precision::Bf16)]))]
    precision: Option<Precision>,
}

impl ModelArguments {
    /// The same weights, sampled in so many steps by this solver.
    pub(crate) fn with_steps(&self, steps: usize, solver: Solver) -> Self {
        Self {
            steps: Some(steps),
            solver: Some(solver),
            ..self.clone()
        }
    }

    /// How the diffusion planners sample, in words.
    pub(crate) fn sampling(&self) -> String {
        let solver = match self.solver.unwrap_or(Solver::Ddim) {
            Solver::Ddim => "DDIM",
            Solver::DpmSolver => "DPM-Solver++",
        };
        format!("{} {solver} steps", self.steps.unwrap_or(STEPS))
    }

    /// Name of the diffusion planners' weights.
    pub(crate) fn diffusion_weights(&self) -> &str {
        self.model.as_deref().unwrap_or(DIFFUSION_WEIGHTS)
    }

    /// Refuses options that the daemon would not read: it serves the weights `fast` of its folder, as they are.
    pub(crate) fn refuse_for_daemon(&self) -> anyhow::Result<()> {
        for (option, given) in [
            ("--model", text(self.model.as_ref())),
            ("--evaluations", text(self.evaluations)),
        ] {
            if let Some(value) = given {
                bail!(
                    "{option} {value} is not read by the daemon, which this figure needs: leave it out"
                );
            }
        }
        Ok(())
    }

    /// Opens the weights that are named, or `default`, and makes a model of their file.
    fn load<M, E: Error + Send + Sync + 'static>(
        &self,
        default: &str,
        make: impl Fn(&WeightsFile) -> Result<M, E>,
    ) -> anyhow::Result<(M, WeightsRecord)> {
        let manifest = Manifest::open(&self.weights).context("--weights")?;
        let name = self.model.as_deref().unwrap_or(default);
        let folder = self.weights.display();
        let file = manifest
            .weights(name)
            .with_context(|| format!("--weights {folder} --model {name}"))?;
        let model = make(&file).with_context(|| format!("weights `{name}` of {folder}"))?;
        let entry = manifest.entry(name)?;
        let record = WeightsRecord {
            model: name.to_owned(),
            sha256: entry.sha256.clone(),
            updates: entry.updates,
        };
        Ok((model, record))
    }

    /// Refuses options that the planner would not read.
    fn refuse_unread(&self, planner: PlannerName) -> anyhow::Result<()> {
        let sampler = planner.sampler();
        let is_fast = matches!(sampler, Some(Sampler::Default | Sampler::Fast));
        let is_diffusion = sampler.and_then(Guidance::of).is_some();
        let learned = (is_fast || is_diffusion, "the learned planners");
        let fast = (is_fast, "fast and default");
        let diffusion = (
            is_diffusion,
            "diffusion, diffusion-post and diffusion-guided",
        );
        for (option, given, (is_read, readers)) in [
            ("--model", text(self.model.as_ref()), learned),
            ("--evaluations", text(self.evaluations), fast),
            ("--steps", text(self.steps), diffusion),
            ("--solver", text(self.solver), diffusion),
            ("--precision", text(self.precision), diffusion),
        ] {
            if let Some(value) = given.filter(|_| !is_read) {
                bail!(
                    "{option} {value} is not read by --planner {}: it goes with {readers}",
                    name_of(&planner)
                );
            }
        }
        Ok(())
    }
}

/// The value of an option, as it is written.
fn text<T: ToString>(given: Option<T>) -> Option<String> {
    given.map(|value| value.to_string())
}

/// The record of the weights that a planner has.
#[derive(Serialize)]
struct WeightsRecord {
    model: String,
    /// Hash of the weights file.
    sha256: String,
    /// Updates of the training.
    updates: u64,
}

/// The record of a planner's few-step model, and how it samples.
#[derive(Serialize)]
pub(crate) struct FastRecord {
    #[serde(flatten)]
    weights: WeightsRecord,
    /// Evaluations of the network in one sample.
    evaluations: usize,
}

/// The record of a planner's diffusion model, and how it samples.
#[derive(Serialize)]
pub(crate) struct DiffusionRecord {
    #[serde(flatten)]
    weights: WeightsRecord,
    /// Steps asked for.
    steps: usize,
    /// Evaluations of the network: fewer where two steps coincide.
    evaluations: usize,
    solver: String,
    precision: String,
}

/// The records of a planner's models; none for a model that it does not have.
#[derive(Default, Serialize)]
pub(crate) struct ModelRecords {
    fast: Option<FastRecord>,
    diffusion: Option<DiffusionRecord>,
}

/// A planner and the record of its models for the results.
pub(crate) struct Loaded {
    pub(crate) planner: Planner,
    pub(crate) records: ModelRecords,
}

/// Makes the planner, loading the weights that the sampler needs.
pub(crate) fn load(
    name: PlannerName,
    robot: UnitRobot,
    arguments: &ModelArguments,
    threads: usize,
) -> anyhow::Result<Loaded> {
    arguments.refuse_unread(name)?;
    let mut records = ModelRecords::default();
    let mut models = Models::default();
    match name.sampler() {
        Some(Sampler::Default | Sampler::Fast) => {
            let (model, record) = load_fast(&robot, arguments)?;
            (models.fast, records.fast) = (Some(model), Some(record));
        }
        Some(Sampler::Diffusion | Sampler::DiffusionPost | Sampler::DiffusionGuided) => {
            let (model, record) = load_diffusion(&robot, arguments)?;
            (models.diffusion, records.diffusion) = (Some(model), Some(record));
        }
        Some(
            Sampler::Straight | Sampler::StraightDrawn | Sampler::RrtConnect | Sampler::RrtSmooth,
        )
        | None => {}
    }
    let planner = Planner::new(robot, models, threads).with_context(|| {
        format!("the planner could not be made (--threads {threads}: fewer are needed where no more can be started)")
    })?;
    Ok(Loaded { planner, records })
}

fn load_fast(
    robot: &UnitRobot,
    arguments: &ModelArguments,
) -> anyhow::Result<(FastModel, FastRecord)> {
    let limit = robot.bending_limit;
    let make = |file: &WeightsFile| FastModel::from_weights(file, limit);
    let (mut model, weights) = arguments.load(FAST_WEIGHTS, make)?;
    if let Some(evaluations) = arguments.evaluations {
        model = model.with_evaluations(evaluations)?;
    }
    let record = FastRecord {
        weights,
        evaluations: model.evaluations(),
    };
    Ok((model, record))
}

fn load_diffusion(
    robot: &UnitRobot,
    arguments: &ModelArguments,
) -> anyhow::Result<(DiffusionModel, DiffusionRecord)> {
    let settings = DiffusionSettings {
        solver: arguments.solver.unwrap_or(Solver::Ddim),
        steps: arguments.steps.unwrap_or(STEPS),
        precision: arguments.precision.unwrap_or(Precision::F32),
    };
    let make = |file: &WeightsFile| TemporalUnet::load(file, robot.bending_limit);
    let (unet, weights) = arguments.load(DIFFUSION_WEIGHTS, make)?;
    let model = DiffusionModel::new(unet, settings)?;
    let record = DiffusionRecord {
        weights,
        steps: settings.steps,
        evaluations: model.evaluations(),
        solver: settings.solver.to_string(),
        precision: settings.precision.to_string(),
    };
    Ok((model, record))
}
