//! What several groups of checks share: the weights in use, unseen data sets, and evaluations.

use std::env;
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, ensure};
use denoiser::Manifest;
use serde_json::Value;
use sha2::{Digest, Sha256};
use tests::programs::{program, repository};

use crate::report::Report;
use crate::scale::Scale;

/// Candidates of every case where nothing else is said, as the paper draws.
pub(crate) const CANDIDATES: usize = 10;
/// The folder of the weights to measure, where it is not the repository's.
const WEIGHTS_VARIABLE: &str = "PCC_WEIGHTS";

/// Where the checks keep their files.
pub(crate) fn folder() -> PathBuf {
    repository().join("target/acceptance")
}

pub(crate) fn run_pcc(arguments: &[&str]) -> anyhow::Result<()> {
    let output = Command::new(program("pcc"))
        .current_dir(repository())
        .args(arguments)
        .output()?;
    let error = String::from_utf8_lossy(&output.stderr);
    ensure!(
        output.status.success(),
        "pcc {}: {error}",
        arguments.join(" ")
    );
    Ok(())
}

/// Makes a data set, on top of what an interrupted run left, or anew where an older generator left something else.
pub(crate) fn make_dataset(arguments: &[&str], out: &Path) -> anyhow::Result<()> {
    let mut whole = vec!["dataset"];
    whole.extend(arguments);
    whole.extend(["--out", out.to_str().context("path")?]);
    if run_pcc(&whole).is_err() && out.exists() {
        fs::remove_dir_all(out)?;
        run_pcc(&whole)?;
    }
    Ok(())
}

/// Where the weights are.
pub(crate) fn weights_folder() -> PathBuf {
    env::var_os(WEIGHTS_VARIABLE).map_or_else(|| repository().join("weights"), PathBuf::from)
}

/// Where the weights of short runs are, each with one thing changed, which nothing but the ablations reads.
pub(crate) fn ablation_folder() -> PathBuf {
    repository().join("tests/data/ablation-weights")
}

/// The manifests' hash: other weights have other hashes in them.
pub(crate) fn weights_in_use() -> String {
    let mut hash = Sha256::new();
    for folder in [weights_folder(), ablation_folder()] {
        hash.update(fs::read(folder.join("MANIFEST.toml")).unwrap_or_default());
    }
    let hash = hash.finalize();
    hash.iter().take(8).map(|b| format!("{b:02x}")).collect()
}

/// Weights of a manifest, and how a line names them.
#[derive(Clone)]
pub(crate) struct Model {
    /// The folder of the manifest.
    folder: PathBuf,
    pub(crate) name: String,
    pub(crate) text: String,
    pub(crate) updates: u64,
}

impl Model {
    /// The weights of a name, or `mixed` where there are none of that name, which the text then says.
    pub(crate) fn wanted(name: &str) -> anyhow::Result<Self> {
        let folder = weights_folder();
        let manifest = Manifest::open(&folder)?;
        if manifest.entry(name).is_ok() {
            return Self::of(&folder, &manifest, name);
        }
        let mut model = Self::of(&folder, &manifest, "mixed")?;
        write!(model.text, ", for the manifest has no {name}")?;
        Ok(model)
    }

    /// All weights of a folder whose names begin so, by their updates.
    pub(crate) fn all(folder: &Path, prefix: &str) -> anyhow::Result<Vec<Self>> {
        let manifest = Manifest::open(folder)?;
        let names = manifest.names().filter(|name| name.starts_with(prefix));
        let mut models = names
            .map(|name| Self::of(folder, &manifest, name))
            .collect::<Result<Vec<_>, _>>()?;
        models.sort_by_key(|model| model.updates);
        Ok(models)
    }

    fn of(folder: &Path, manifest: &Manifest, name: &str) -> anyhow::Result<Self> {
        let updates = manifest.entry(name)?.updates;
        Ok(Self {
            folder: folder.to_owned(),
            name: name.to_owned(),
            text: format!("weights {name} of {updates} updates"),
            updates,
        })
    }

    /// Channels of the network's first level.
    pub(crate) fn width(&self) -> anyhow::Result<usize> {
        let file = Manifest::open(&self.folder)?.weights(&self.name)?;
        Ok(file.count("width")?)
    }

    /// Seeds of the data sets that it was trained with.
    pub(crate) fn training_seeds(&self) -> anyhow::Result<Vec<u64>> {
        let manifest = Manifest::open(&self.folder)?;
        let seeds = manifest.entry(&self.name)?.training_seeds.clone();
        ensure!(!seeds.is_empty(), "{}: no training_seeds", self.text);
        Ok(seeds)
    }

    /// Rows of all updates of the training; weights of one run may not say it.
    pub(crate) fn rows_used(&self) -> anyhow::Result<u64> {
        let file = Manifest::open(&self.folder)?.weights(&self.name)?;
        match file.metadata("rows_used") {
            Some(_) => Ok(file.count("rows_used")? as u64),
            None => Ok(self.updates * file.count("batch")? as u64),
        }
    }
}

/// A data set that is made on the spot, with a seed that no training data has.
pub(crate) struct Unseen {
    pub(crate) name: &'static str,
    pub(crate) method: &'static str,
    pub(crate) setting: &'static str,
    pub(crate) seed: u64,
    /// Starts of each target.
    pub(crate) starts: usize,
    /// Goal configurations of each start.
    pub(crate) ends: usize,
    /// Targets drawn for 10 cases: some are dropped.
    pub(crate) targets_for_ten_cases: usize,
    /// Weights trained for it.
    pub(crate) weights: &'static str,
}

impl Unseen {
    pub(crate) fn model(&self) -> anyhow::Result<Model> {
        Model::wanted(self.weights)
    }

    /// Its name in the lines: hard scenes are drawn until a planner solves them.
    pub(crate) fn title(&self) -> &'static str {
        match self.setting {
            "hard" => title_of(self.setting),
            _ => self.name,
        }
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

    /// Makes it, with at least so many cases; blocks that are there already stay.
    pub(crate) fn make(&self, cases: usize) -> anyhow::Result<PathBuf> {
        let targets = (cases * self.targets_for_ten_cases).div_ceil(10) + 4;
        let Self {
            name,
            method,
            seed,
            starts,
            ends,
            ..
        } = self;
        let out = folder().join(format!("{method}-{name}-{seed}-{targets}x{starts}x{ends}"));
        eprintln!("  making {targets} {name} targets");
        let [seed, targets] = [*seed, targets as u64].map(|number| number.to_string());
        let [starts, ends] = [starts, ends].map(ToString::to_string);
        let mut arguments = vec!["--method", self.method, "--setting", self.setting];
        arguments.extend(["--test-only", "--seed", &seed, "--targets", &targets]);
        arguments.extend(["--starts", &starts, "--ends", &ends]);
        make_dataset(&arguments, &out)?;
        Ok(out)
    }
}

/// The name of a set in the lines, with what it leaves out.
pub(crate) fn title_of(set: &str) -> &str {
    match set {
        "hard" => "hard (drawn such that segments collide and rrt-connect finds a path)",
        "reference" => {
            "reference (without the starts for which the authors' generator keeps no path)"
        }
        _ => set,
    }
}

/// One run of `pcc evaluate`.
#[derive(Clone)]
pub(crate) struct Evaluation<'a> {
    setting: &'a str,
    dataset: &'a Path,
    planner: &'a str,
    cases: usize,
    candidates: usize,
    weights: PathBuf,
    options: Vec<(&'static str, String)>,
}

impl<'a> Evaluation<'a> {
    /// With ten candidates a case; `setting` is part of the name of the folder with its files.
    pub(crate) fn of(setting: &'a str, dataset: &'a Path, planner: &'a str, cases: usize) -> Self {
        Self {
            setting,
            dataset,
            planner,
            cases,
            candidates: CANDIDATES,
            weights: weights_folder(),
            options: Vec::new(),
        }
    }

    pub(crate) fn candidates(self, candidates: usize) -> Self {
        Self { candidates, ..self }
    }

    /// With one more option of `pcc evaluate`.
    pub(crate) fn with(mut self, option: &'static str, value: &(impl ToString + ?Sized)) -> Self {
        self.options.push((option, value.to_string()));
        self
    }

    /// With these weights, wherever they are.
    pub(crate) fn model(self, model: &Model) -> Self {
        let weights = model.folder.clone();
        Self { weights, ..self }.with("--model", &model.name)
    }

    /// Where its files are.
    pub(crate) fn out(&self) -> PathBuf {
        let options = self.options.iter();
        let options: String = options
            .map(|(option, value)| format!("{}-{}", &option[1..], value.replace('/', "-")))
            .collect();
        let Self {
            setting,
            planner,
            candidates,
            ..
        } = self;
        let name = format!("{setting}-{planner}-{candidates}{options}");
        folder().join(name)
    }

    /// Runs it and reads `result.json`; in a full run, one that was finished before an interruption is not repeated, unless files differ
    /// from the commit: what they were then is not known.
    pub(crate) fn run(&self, report: &Report, scale: Scale) -> anyhow::Result<Value> {
        let mark = format!("{}\n{}\n", report.subject(), self.arguments()?.join(" "));
        let marked = self.out().join("finished.txt");
        let is_known = fs::read_to_string(&marked).is_ok_and(|found| found == mark);
        if scale.full && is_known && report.is_of_a_commit() {
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
            ("--weights", path(&self.weights)?),
            ("--candidates", self.candidates.to_string()),
            ("--seed", "0".to_owned()),
            ("--cases", self.cases.to_string()),
            ("--out", path(&self.out())?),
        ];
        let pairs = pairs.into_iter().chain(self.options.iter().cloned());
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
