//! What several groups of the paper's checks share: the weights in use, unseen data sets, and evaluations.

use std::env;
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::Context;
use denoiser::Manifest;
use serde_json::Value;
use sha2::{Digest, Sha256};
use tests::programs::repository;

use crate::evaluation::{folder, make_dataset, run_pcc};
use crate::{Report, Scale};

/// Candidates of every case, as the paper draws.
pub(crate) const CANDIDATES: usize = 10;
/// The folder of the weights to measure, where it is not the repository's.
const WEIGHTS_VARIABLE: &str = "PCC_WEIGHTS";

/// Cases of every ablation; those with and without lower precision are the same.
pub(crate) fn ablation_cases(scale: Scale) -> usize {
    scale.pick(20, 300)
}

/// Where the weights are.
pub(crate) fn weights_folder() -> PathBuf {
    env::var_os(WEIGHTS_VARIABLE).map_or_else(|| repository().join("weights"), PathBuf::from)
}

/// The manifest's hash: other weights have other hashes in it.
pub(crate) fn weights_in_use() -> String {
    let manifest = fs::read(weights_folder().join("MANIFEST.toml")).unwrap_or_default();
    let hash = Sha256::digest(&manifest);
    hash.iter().take(8).map(|b| format!("{b:02x}")).collect()
}

/// Weights of the manifest, and how a line names them.
#[derive(Clone)]
pub(crate) struct Model {
    pub(crate) name: String,
    pub(crate) text: String,
    pub(crate) updates: u64,
}

impl Model {
    /// The weights of a name, or `mixed` where there are none of that name, which the text then says.
    pub(crate) fn wanted(name: &str) -> anyhow::Result<Self> {
        let manifest = Manifest::open(&weights_folder())?;
        if manifest.entry(name).is_ok() {
            return Self::of(&manifest, name);
        }
        let mut model = Self::of(&manifest, "mixed")?;
        write!(model.text, ", for the manifest has no {name}")?;
        Ok(model)
    }

    /// All weights whose names begin so, by their updates.
    pub(crate) fn all(prefix: &str) -> anyhow::Result<Vec<Self>> {
        let manifest = Manifest::open(&weights_folder())?;
        let names = manifest.names().filter(|name| name.starts_with(prefix));
        let mut models = names
            .map(|name| Self::of(&manifest, name))
            .collect::<Result<Vec<_>, _>>()?;
        models.sort_by_key(|model| model.updates);
        Ok(models)
    }

    fn of(manifest: &Manifest, name: &str) -> anyhow::Result<Self> {
        let updates = manifest.entry(name)?.updates;
        Ok(Self {
            name: name.to_owned(),
            text: format!("weights {name} of {updates} updates"),
            updates,
        })
    }

    /// Channels of the network's first level.
    pub(crate) fn width(&self) -> anyhow::Result<usize> {
        let file = Manifest::open(&weights_folder())?.weights(&self.name)?;
        Ok(file.count("width")?)
    }
}

/// A data set that is made on the spot, with a seed that no training data has.
pub(crate) struct Unseen {
    pub(crate) name: &'static str,
    method: &'static str,
    setting: &'static str,
    seed: u64,
    /// Starts of each target.
    starts: usize,
    /// Targets drawn for 10 cases: some are dropped.
    targets_for_ten_cases: usize,
    /// Weights trained for it.
    weights: &'static str,
}

const fn of_the_paper(
    name: &'static str,
    setting: &'static str,
    seed: u64,
    weights: &'static str,
) -> Unseen {
    Unseen {
        name,
        method: "paper",
        setting,
        seed,
        starts: 5,
        targets_for_ten_cases: 4,
        weights,
    }
}

pub(crate) const MIXED: Unseen = of_the_paper("mixed", "reference", 9003, "mixed");
pub(crate) const FREE: Unseen = of_the_paper("obstacle-free", "obstacle-free", 9004, "free");
pub(crate) const GENERAL: Unseen = of_the_paper("general", "general", 9005, "general");
pub(crate) const HARD: Unseen = Unseen {
    name: "hard",
    method: "teacher",
    setting: "hard",
    seed: 9002,
    starts: 3,
    targets_for_ten_cases: 9,
    weights: "general",
};

impl Unseen {
    pub(crate) fn model(&self) -> anyhow::Result<Model> {
        Model::wanted(self.weights)
    }

    /// How it is made, for the lines.
    pub(crate) fn command(&self) -> String {
        let Self {
            method,
            setting,
            seed,
            ..
        } = self;
        format!("pcc dataset --method {method} --setting {setting} --test-only --seed {seed}")
    }

    /// Makes it, with at least so many cases and all ten end shapes of each; blocks that are there already stay.
    pub(crate) fn make(&self, cases: usize) -> anyhow::Result<PathBuf> {
        let targets = (cases * self.targets_for_ten_cases).div_ceil(10) + 4;
        let out = folder().join(format!("paper-{}-{}-{targets}", self.name, self.seed));
        eprintln!("  making {} {} targets", targets, self.name);
        let (seed, targets) = (self.seed.to_string(), targets.to_string());
        let starts = self.starts.to_string();
        let mut arguments = vec!["--method", self.method, "--setting", self.setting];
        arguments.extend(["--test-only", "--seed", &seed, "--targets", &targets]);
        arguments.extend(["--starts", &starts, "--ends", "10"]);
        make_dataset(&arguments, &out)?;
        Ok(out)
    }
}

/// One run of `pcc evaluate`; what is not named is the paper's.
#[derive(Clone)]
pub(crate) struct Evaluation<'a> {
    pub(crate) setting: &'a str,
    pub(crate) dataset: &'a Path,
    pub(crate) model: &'a Model,
    pub(crate) planner: &'a str,
    pub(crate) cases: usize,
    pub(crate) candidates: usize,
    pub(crate) steps: usize,
    pub(crate) solver: &'a str,
    pub(crate) precision: &'a str,
}

impl<'a> Evaluation<'a> {
    pub(crate) fn of(
        setting: &'a str,
        dataset: &'a Path,
        model: &'a Model,
        planner: &'a str,
        cases: usize,
    ) -> Self {
        Self {
            setting,
            dataset,
            model,
            planner,
            cases,
            candidates: CANDIDATES,
            steps: 50,
            solver: "ddim",
            precision: "f32",
        }
    }

    /// Where its files are.
    pub(crate) fn out(&self) -> PathBuf {
        let Self {
            setting,
            planner,
            candidates,
            steps,
            solver,
            precision,
            ..
        } = self;
        folder().join(format!(
            "paper-{setting}-{planner}-{solver}-{steps}-{precision}-{candidates}"
        ))
    }

    /// Runs it and reads `result.json`; in a full run, one that was finished before an interruption is not repeated.
    pub(crate) fn run(&self, report: &Report, scale: Scale) -> anyhow::Result<Value> {
        let mark = format!("{}\n{}\n", report.subject(), self.arguments()?.join(" "));
        let marked = self.out().join("finished.txt");
        let is_known = fs::read_to_string(&marked).is_ok_and(|found| found == mark);
        if scale.full && is_known {
            return self.result();
        }
        let result = self.repeat()?;
        fs::write(&marked, mark)?;
        Ok(result)
    }

    /// Runs it, whatever was measured before, and reads `result.json`.
    pub(crate) fn repeat(&self) -> anyhow::Result<Value> {
        let Self {
            setting,
            planner,
            cases,
            ..
        } = self;
        eprintln!("  {setting}, {planner}: {cases} cases");
        let arguments = self.arguments()?;
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        if self.out().exists() {
            fs::remove_dir_all(self.out())?;
        }
        run_pcc(&arguments)?;
        self.result()
    }

    fn result(&self) -> anyhow::Result<Value> {
        let text = fs::read_to_string(self.out().join("result.json"))?;
        Ok(serde_json::from_str(&text)?)
    }

    fn arguments(&self) -> anyhow::Result<Vec<String>> {
        let path = |path: &Path| path.to_str().map(str::to_owned).context("path");
        let pairs = [
            ("--dataset", path(self.dataset)?),
            ("--split", "test".to_owned()),
            ("--planner", self.planner.to_owned()),
            ("--weights", path(&weights_folder())?),
            ("--candidates", self.candidates.to_string()),
            ("--seed", "0".to_owned()),
            ("--cases", self.cases.to_string()),
            ("--out", path(&self.out())?),
        ];
        let of_sampler = [
            ("--model", self.model.name.clone()),
            ("--steps", self.steps.to_string()),
            ("--solver", self.solver.to_owned()),
            ("--precision", self.precision.to_owned()),
        ];
        let samples = self.planner.starts_with("diffusion");
        let pairs = pairs
            .into_iter()
            .chain(of_sampler.into_iter().filter(|_| samples));
        let words = pairs.flat_map(|(name, value)| [name.to_owned(), value]);
        Ok(std::iter::once("evaluate".to_owned())
            .chain(words)
            .collect())
    }
}

/// A number of `result.json`; none where there was nothing to measure.
pub(crate) fn figure(result: &Value, path: &str) -> anyhow::Result<Option<f64>> {
    let found = result.pointer(path);
    let found = found.with_context(|| format!("result.json has no {path}"))?;
    Ok(found.as_f64())
}

/// A number of `result.json` that must be there.
pub(crate) fn number(result: &Value, path: &str) -> anyhow::Result<f64> {
    figure(result, path)?.with_context(|| format!("result.json has no number at {path}"))
}

/// The middle one, or the upper of the two.
pub(crate) fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
}
