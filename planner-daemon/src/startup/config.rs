//! The daemon's settings (`config/planner-daemon.toml` says what each means).

use std::fmt::{self, Display, Formatter};
use std::path::{Path, PathBuf};
use std::time::Duration;

use denoiser::{Precision, Solver};
use input_files::{MAX_SETTINGS_BYTES, SettingsError, SettingsFile, named, read_text};
use planning::DiffusionSettings;
use serde::Deserialize;
use shared_types::capacity::{MAX_CANDIDATES, MAX_KNOTS};
use shared_types::ipc::PlanServiceCapacity;
use shared_types::valid::LEAST_PATH_TOLERANCE_RAD;

use crate::requests::{PlannerKind, WaitMode};

/// Why a configuration is refused.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The file is not read or not understood, or a setting is outside its range.
    #[error("configuration: {0}")]
    Settings(#[from] SettingsError),
    /// A thread that always looks and always comes first would keep its processor for ever.
    #[error(
        "configuration {path:?}: wait = \"poll\" allows no realtime_priority but 0, since such a thread never lets go of its processor"
    )]
    PollsAtRealtimePriority {
        /// The file.
        path: PathBuf,
    },
    /// The diffusion model has no folder to come from.
    #[error("configuration {path:?}: [diffusion] needs `weights`, the folder that its model is in")]
    DiffusionWithoutWeights {
        /// The file.
        path: PathBuf,
    },
}

input_files::settings_file! {
    /// What the file says, with the defaults of what it does not.
    #[derive(Clone, Debug)]
    struct File {
        robot: PathBuf,
        weights: Option<PathBuf>,
        diffusion: Option<DiffusionConfig>,
        scene: Option<SceneConfig>,
    }
    defaults {
        live_scene: LiveSceneConfig = LiveSceneConfig::default(),
        planner: PlannerKind = PlannerKind::Pcc,
        threads: usize = 2,
        candidates: usize = 16,
        knots_per_candidate: usize = 96,
        clients: usize = 4,
        requests_per_client: usize = 4,
        queued_per_client: usize = 4,
        default_deadline_ms: f64 = 20.0,
        path_tolerance_rad: f64 = 0.01,
        begin_lead_ms: f64 = 50.0,
        wait: WaitMode = WaitMode::Event,
        realtime_priority: i64 = 0,
        processors: Vec<usize> = Vec::new(),
        lock_memory: bool = true,
        shared_memory_budget_mb: f64 = 48.0,
        resident_memory_budget_mb: f64 = 250.0,
    }
}

/// Where the static scene is.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct SceneConfig {
    file: PathBuf,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct LiveSceneConfig {
    expected: bool,
}

/// Which diffusion model is resident, and how it is sampled.
#[derive(Clone, Debug, Deserialize, PartialEq, Eq)]
#[serde(deny_unknown_fields)]
pub struct DiffusionConfig {
    /// Name of the weights in the manifest.
    pub model: String,
    /// How noise is removed.
    #[serde(deserialize_with = "named")]
    pub solver: Solver,
    /// Evaluations of the network.
    pub steps: usize,
    /// Arithmetic of the network's products.
    #[serde(deserialize_with = "named")]
    pub precision: Precision,
}

impl Display for DiffusionConfig {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self {
            model,
            solver,
            steps,
            precision,
        } = self;
        write!(f, "{model} ({steps} steps of {solver}, {precision})")
    }
}

impl DiffusionConfig {
    pub(crate) fn settings(&self) -> DiffusionSettings {
        DiffusionSettings {
            solver: self.solver,
            steps: self.steps,
            precision: self.precision,
        }
    }
}

/// Checked settings.
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    /// The robot file.
    pub robot: PathBuf,
    /// Folder of the learned model, if one is to be loaded.
    pub weights: Option<PathBuf>,
    /// The diffusion model, if one is to be loaded.
    pub diffusion: Option<DiffusionConfig>,
    /// File of the obstacles that are part of every request's scene, if there are any.
    pub scene: Option<PathBuf>,
    /// Whether execution needs a live scene of at least one source.
    pub scene_expected: bool,
    /// What answers requests.
    pub planner: PlannerKind,
    /// Worker threads that plan.
    pub threads: usize,
    /// What the plan service holds.
    pub capacity: PlanServiceCapacity,
    /// Requests of one client that may wait.
    pub queued_per_client: usize,
    /// Time that an answer may take where the request does not say.
    pub default_deadline: Duration,
    /// Tracking error that delivered motions are certified for, rad in each bending pair.
    pub path_tolerance_rad: f64,
    /// Least time between publishing a motion and its begin.
    pub begin_lead: Duration,
    /// How to wait for requests.
    pub wait: WaitMode,
    /// Priority of planning under SCHED_FIFO, `None` for none; service and heartbeat have the next higher one, supervision the one above.
    pub realtime_priority: Option<u8>,
    /// Processors to run on; empty for all.
    pub processors: Vec<usize>,
    /// Whether to keep memory from being swapped out, and to bring in the shared memory of the answers at the start.
    pub lock_memory: bool,
    /// Shared memory that the services may take, bytes.
    pub shared_memory_budget: usize,
    /// Resident memory that the daemon may take after its start, bytes.
    pub resident_memory_budget: usize,
}

impl Config {
    /// Reads and checks a configuration file; the paths in it are relative to its folder.
    ///
    /// # Errors
    /// [`ConfigError`], naming the file, the setting and what is allowed.
    pub fn from_file(path: &Path) -> Result<Self, ConfigError> {
        let text = read_text(path, MAX_SETTINGS_BYTES).map_err(SettingsError::from)?;
        Self::from_toml_str(&text, path)
    }

    /// Checks the text of a configuration file that lies at `path`.
    ///
    /// # Errors
    /// As [`Config::from_file`].
    pub fn from_toml_str(text: &str, path: &Path) -> Result<Self, ConfigError> {
        let settings = SettingsFile { path };
        let file: File = settings.parse(text)?;
        file.check(&settings)?;
        let folder = path.parent().unwrap_or(Path::new("."));
        Ok(file.settings(folder))
    }
}

impl File {
    fn check(&self, checked: &SettingsFile) -> Result<(), ConfigError> {
        checked.within("threads", self.threads, 1..=64)?;
        self.check_capacity(checked)?;
        let deadlines = 1e-3..=60_000.0;
        checked.within("default_deadline_ms", self.default_deadline_ms, deadlines)?;
        let tolerances = LEAST_PATH_TOLERANCE_RAD..=0.1;
        checked.within("path_tolerance_rad", self.path_tolerance_rad, tolerances)?;
        checked.within("begin_lead_ms", self.begin_lead_ms, 10.0..=1000.0)?;
        if let Some(diffusion) = &self.diffusion {
            checked.within("diffusion.steps", diffusion.steps, 1..=1000)?;
            if self.weights.is_none() {
                let path = checked.path.to_owned();
                return Err(ConfigError::DiffusionWithoutWeights { path });
            }
        }
        checked.within("realtime_priority", self.realtime_priority, 0..=68)?;
        if self.wait == WaitMode::Poll && self.realtime_priority > 0 {
            let path = checked.path.to_owned();
            return Err(ConfigError::PollsAtRealtimePriority { path });
        }
        for processor in &self.processors {
            checked.within("processors", *processor, 0..=1023)?;
        }
        Ok(())
    }

    /// Checks what decides how much memory the daemon takes, and how much it may take.
    fn check_capacity(&self, checked: &SettingsFile) -> Result<(), SettingsError> {
        checked.within("candidates", self.candidates, 1..=MAX_CANDIDATES)?;
        let knots = self.knots_per_candidate;
        checked.within("knots_per_candidate", knots, 16..=MAX_KNOTS)?;
        checked.within("clients", self.clients, 1..=64)?;
        checked.within("requests_per_client", self.requests_per_client, 1..=16)?;
        checked.within("queued_per_client", self.queued_per_client, 1..=16)?;
        for (key, megabytes) in [
            ("shared_memory_budget_mb", self.shared_memory_budget_mb),
            ("resident_memory_budget_mb", self.resident_memory_budget_mb),
        ] {
            checked.within(key, megabytes, 1.0..=100_000.0)?;
        }
        Ok(())
    }

    fn settings(self, folder: &Path) -> Config {
        let milliseconds = |value: f64| Duration::from_secs_f64(value * 1e-3);
        Config {
            robot: folder.join(&self.robot),
            weights: self.weights.as_ref().map(|weights| folder.join(weights)),
            diffusion: self.diffusion,
            scene: self.scene.map(|scene| folder.join(scene.file)),
            scene_expected: self.live_scene.expected,
            planner: self.planner,
            threads: self.threads,
            capacity: PlanServiceCapacity {
                clients: self.clients,
                active_requests_per_client: self.requests_per_client,
                candidates: self.candidates,
                knots_per_candidate: self.knots_per_candidate,
            },
            queued_per_client: self.queued_per_client,
            default_deadline: milliseconds(self.default_deadline_ms),
            path_tolerance_rad: self.path_tolerance_rad,
            begin_lead: milliseconds(self.begin_lead_ms),
            wait: self.wait,
            realtime_priority: u8::try_from(self.realtime_priority)
                .ok()
                .filter(|priority| *priority > 0),
            processors: self.processors,
            lock_memory: self.lock_memory,
            shared_memory_budget: (self.shared_memory_budget_mb * 1e6) as usize,
            resident_memory_budget: (self.resident_memory_budget_mb * 1e6) as usize,
        }
    }
}

#[cfg(test)]
mod tests;
