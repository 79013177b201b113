//! Everything that a process must refuse to start with: weights, robot files, configurations.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use sha2::{Digest, Sha256};
use toml::{Table, Value};

use crate::process::Process;
use crate::programs::repository;
use crate::world::{Settings, World, shipped};

/// How long a refusal may take.
const PATIENCE: Duration = Duration::from_secs(60);

/// What became of the bad starts.
#[derive(Clone, Debug, Default)]
pub struct BadStarts {
    /// Starts tried.
    pub tried: usize,
    /// Those that ended with another status than 0 and the text expected.
    pub named: usize,
    /// What was not as expected.
    pub unexpected: Vec<String>,
}

/// A change to a configuration, and what the refusal must name.
type Bad = (&'static str, fn(&mut Table), &'static str);

const ROBOT_FILES: &[Bad] = &[
    ("unknown key", |t| set(t, "colour", "red"), "colour"),
    (
        "missing key",
        |t| drop(t.remove("tube_radius_m")),
        "tube_radius_m",
    ),
    (
        "negative length",
        |t| set(t, "section_lengths_m", lengths(-1.0)),
        "section_lengths_m",
    ),
    (
        "length NaN",
        |t| set(t, "section_lengths_m", lengths(f64::NAN)),
        "section_lengths_m",
    ),
    (
        "bends by more than π",
        |t| set(t, "bending_limit_rad", 4.0),
        "bending_limit_rad",
    ),
    (
        "infinite radius",
        |t| set(t, "tube_radius_m", f64::INFINITY),
        "tube_radius_m",
    ),
    (
        "no spool",
        |t| set(t, "spool_radius_m", 0.0),
        "spool_radius_m",
    ),
    (
        "no velocity",
        |t| set_limit(t, "velocity_m_s", 0.0),
        "velocity_m_s",
    ),
    (
        "acceleration NaN",
        |t| set_limit(t, "acceleration_m_s2", f64::NAN),
        "acceleration_m_s2",
    ),
    (
        "negative jerk",
        |t| set_limit(t, "jerk_m_s3", -1.0),
        "jerk_m_s3",
    ),
    (
        "no tendons",
        |t| set(t, "tendons", Vec::<Value>::new()),
        "tendon",
    ),
    (
        "tendon of section 4",
        |t| set_tendon(t, "section", 4),
        "section",
    ),
    (
        "tendon circle NaN",
        |t| set_tendon(t, "radius_m", f64::NAN),
        "radius",
    ),
    (
        "text for a number",
        |t| set(t, "bending_limit_rad", "wide"),
        "bending_limit_rad",
    ),
];

const DAEMON: &[Bad] = &[
    ("unknown key", |t| set(t, "thread", 2), "thread"),
    ("missing robot", |t| drop(t.remove("robot")), "robot"),
    ("text for a number", |t| set(t, "threads", "two"), "threads"),
    ("no threads", |t| set(t, "threads", 0), "threads"),
    ("65 candidates", |t| set(t, "candidates", 65), "candidates"),
    (
        "257 knots",
        |t| set(t, "knots_per_candidate", 257),
        "knots_per_candidate",
    ),
    (
        "tolerance NaN",
        |t| set(t, "path_tolerance_rad", f64::NAN),
        "path_tolerance_rad",
    ),
    ("unknown wait", |t| set(t, "wait", "sleep"), "sleep"),
    (
        "over its shared memory",
        |t| (set(t, "candidates", 64), set(t, "clients", 64)).1,
        "shared",
    ),
    (
        "over its resident memory",
        |t| set(t, "resident_memory_budget_mb", 1.0),
        "resident",
    ),
    (
        "robot file missing",
        |t| set(t, "robot", "robots/none.toml"),
        "none.toml",
    ),
    (
        "weights missing",
        |t| set(t, "weights", "/nonexistent"),
        "/nonexistent",
    ),
    (
        "diffusion without weights",
        |t| {
            set_diffusion(t, |_| ());
            t.remove("weights");
        },
        "[diffusion] needs `weights`",
    ),
    (
        "no diffusion steps",
        |t| set_diffusion(t, |d| set(d, "steps", 0)),
        "diffusion.steps = 0",
    ),
    (
        "1001 diffusion steps",
        |t| set_diffusion(t, |d| set(d, "steps", 1001)),
        "diffusion.steps = 1001",
    ),
    (
        "unknown solver",
        |t| set_diffusion(t, |d| set(d, "solver", "euler")),
        "`ddim` or `dpm-solver`",
    ),
    (
        "diffusion without a model",
        |t| set_diffusion(t, |d| drop(d.remove("model"))),
        "model",
    ),
    (
        "unknown key of the diffusion model",
        |t| set_diffusion(t, |d| set(d, "colour", "red")),
        "colour",
    ),
];

const CONTROLLER: &[Bad] = &[
    ("unknown key", |t| set(t, "rate", 1000), "rate"),
    ("too fast", |t| set(t, "rate_hz", 5000), "rate_hz"),
    (
        "step cap NaN",
        |t| set(t, "step_cap_ms", f64::NAN),
        "step_cap_ms",
    ),
    (
        "robot file missing",
        |t| set(t, "robot", "robots/none.toml"),
        "none.toml",
    ),
];

const ROBOT: &[Bad] = &[
    ("unknown key", |t| set(t, "weight", 1.0), "weight"),
    ("negative noise", |t| set(t, "noise", -1.0), "noise"),
    (
        "text for a number",
        |t| set(t, "rate_hz", "fast"),
        "rate_hz",
    ),
    (
        "robot file missing",
        |t| set(t, "robot", "robots/none.toml"),
        "none.toml",
    ),
];

pub(crate) fn set(table: &mut Table, key: &str, value: impl Into<Value>) {
    table.insert(key.to_owned(), value.into());
}

/// Asks for a diffusion model, whose settings are then changed.
fn set_diffusion(table: &mut Table, change: fn(&mut Table)) {
    let mut diffusion = Table::new();
    for (key, value) in [("model", "mixed"), ("solver", "ddim"), ("precision", "f32")] {
        set(&mut diffusion, key, value);
    }
    set(&mut diffusion, "steps", 50);
    change(&mut diffusion);
    set(table, "weights", "weights");
    set(table, "diffusion", diffusion);
}

fn lengths(first: f64) -> Vec<f64> {
    vec![first, 1.0, 1.0]
}

fn set_limit(table: &mut Table, key: &str, value: f64) {
    set(table["tendon_limits"].as_table_mut().unwrap(), key, value);
}

fn set_tendon(table: &mut Table, key: &str, value: impl Into<Value>) {
    let tendons = table["tendons"].as_array_mut().unwrap();
    set(tendons[0].as_table_mut().unwrap(), key, value);
}

/// Bad robot files, given to each of the three programs.
#[must_use]
pub fn robot_files() -> BadStarts {
    let mut starts = BadStarts::default();
    for program in ["planner-daemon", "controller", "simulated-robot"] {
        for (name, change, named) in ROBOT_FILES {
            let world = World::new(&Settings::default());
            let mut robot = shipped("robots/unit.toml");
            change(&mut robot);
            fs::write(world.config("robots/unit.toml"), robot.to_string()).unwrap();
            starts.refuse(&world, program, name, named);
        }
    }
    starts
}

/// Bad configurations of each program, missing files, and an unusable prefix.
#[must_use]
pub fn configurations() -> BadStarts {
    let mut starts = BadStarts::default();
    let programs = [
        ("planner-daemon", DAEMON),
        ("controller", CONTROLLER),
        ("simulated-robot", ROBOT),
    ];
    for (program, cases) in programs {
        let file = format!("{program}.toml");
        for (name, change, named) in cases {
            let world = World::new(&Settings::default());
            edit(&world.config(&file), change);
            starts.refuse(&world, program, name, named);
        }
        let world = World::new(&Settings::default());
        fs::write(world.config(&file), "robot = ").unwrap();
        starts.refuse(&world, program, "broken TOML", &file);
        fs::remove_file(world.config(&file)).unwrap();
        starts.refuse(&world, program, "no configuration", &file);
        let mut world = World::new(&Settings::default());
        world.options.prefix = "a/b".to_owned();
        starts.refuse(&world, program, "unusable prefix", "PCC_PREFIX");
    }
    starts
}

/// Weights that the daemon must refuse.
///
/// # Panics
/// Where no model is shipped.
#[must_use]
pub fn weights() -> BadStarts {
    let mut starts = BadStarts::default();
    type Damage = fn(&mut Weights);
    let damages: [(&str, Damage, &str); 7] = [
        ("truncated", Weights::truncate, "has bytes"),
        ("one bit", Weights::flip_a_bit, "sha256"),
        ("NaN", Weights::put_nan, "has the value NaN"),
        (
            "no safetensors",
            |w| (w.content[..8].fill(0xff), w.sign()).1,
            "safetensors",
        ),
        (
            "not in the manifest",
            |w| w.rename(),
            "has no weights `fast`",
        ),
        (
            "unknown manifest key",
            |w| set(w.entry(), "colour", "red"),
            "MANIFEST.toml",
        ),
        (
            "file missing",
            |w| set(w.entry(), "file", "none.safetensors"),
            "none.safetensors",
        ),
    ];
    for (name, damage, named) in damages {
        let world = World::new(&Settings::default());
        let mut weights = Weights::shipped().expect("weights are part of the repository");
        damage(&mut weights);
        let folder = weights.write(&world);
        edit(&world.config("planner-daemon.toml"), &|daemon| {
            set(daemon, "weights", folder.to_str().unwrap());
        });
        starts.refuse(&world, "planner-daemon", name, named);
    }
    let world = World::new(&Settings::default());
    edit(&world.config("robots/unit.toml"), &|robot| {
        set(robot, "bending_limit_rad", 1.2);
    });
    starts.refuse(&world, "planner-daemon", "another robot's", "another robot");
    starts
}

pub(crate) fn edit(file: &Path, change: &dyn Fn(&mut Table)) {
    let mut table: Table = fs::read_to_string(file).unwrap().parse().unwrap();
    change(&mut table);
    fs::write(file, table.to_string()).unwrap();
}

impl BadStarts {
    fn refuse(&mut self, world: &World, program: &str, name: &str, named: &str) {
        let config = world.config(&format!("{program}.toml"));
        let arguments = ["--config", config.to_str().unwrap()];
        self.refuse_with(world, (program, &arguments), name, named);
    }

    /// Runs a program with these arguments, which must end with status 1 and name what is wrong.
    pub(crate) fn refuse_with(
        &mut self,
        world: &World,
        (program, arguments): (&str, &[&str]),
        name: &str,
        named: &str,
    ) {
        let mut process = Process::start(world, program, arguments);
        let status = process.wait(PATIENCE);
        let log = process.log();
        self.tried += 1;
        let failed = status.as_ref().is_ok_and(|status| status.code() == Some(1));
        if failed && log.contains(named) {
            self.named += 1;
        } else {
            let ended = status.map_or_else(|_| "goes on".to_owned(), |status| status.to_string());
            let found = format!("{program}, {name}: {ended}, does not name {named:?}: {log}");
            self.unexpected.push(found);
        }
    }
}

/// A manifest and one of its weights files, to be damaged.
pub(crate) struct Weights {
    manifest: Table,
    name: String,
    content: Vec<u8>,
    file: PathBuf,
}

impl Weights {
    /// What is shipped, under the name that the daemon loads.
    fn shipped() -> Option<Self> {
        Self::read(&repository().join("weights"), "fast")
    }

    /// What a folder has under a name.
    pub(crate) fn read(folder: &Path, name: &str) -> Option<Self> {
        let manifest: Table = fs::read_to_string(folder.join("MANIFEST.toml"))
            .ok()?
            .parse()
            .ok()?;
        let file = PathBuf::from(manifest.get(name)?["file"].as_str()?);
        let content = fs::read(folder.join(&file)).ok()?;
        Some(Self {
            manifest,
            name: name.to_owned(),
            content,
            file,
        })
    }

    fn entry(&mut self) -> &mut Table {
        self.manifest[&self.name].as_table_mut().unwrap()
    }

    /// Cuts half of it off.
    pub(crate) fn truncate(&mut self) {
        self.content.truncate(self.content.len() / 2);
    }

    /// Changes a bit of its last value.
    pub(crate) fn flip_a_bit(&mut self) {
        *self.content.last_mut().unwrap() ^= 1;
    }

    /// Replaces text of the file's header by other text of the same length; the manifest then fits again.
    pub(crate) fn replace(&mut self, old: &str, new: &str) {
        assert_eq!(old.len(), new.len(), "{old} and {new}");
        let windows = self.content.windows(old.len());
        let at = windows.clone().position(|bytes| bytes == old.as_bytes());
        let at = at.unwrap_or_else(|| panic!("{} has no {old}", self.file.display()));
        self.content[at..at + new.len()].copy_from_slice(new.as_bytes());
        self.sign();
    }

    /// Adds what another folder's manifest has under a name, to be written beside it.
    pub(crate) fn add(&mut self, other: &Self) {
        let entry = other.manifest[&other.name].clone();
        self.manifest.insert(other.name.clone(), entry);
    }

    /// Makes the manifest fit the content again.
    fn sign(&mut self) {
        let digest = Sha256::digest(&self.content);
        let text: String = digest.iter().map(|byte| format!("{byte:02x}")).collect();
        set(self.entry(), "sha256", text);
    }

    /// The last value of the last tensor; the manifest then fits again.
    pub(crate) fn put_nan(&mut self) {
        let end = self.content.len();
        self.content[end - 4..].copy_from_slice(&f32::NAN.to_le_bytes());
        self.sign();
    }

    fn rename(&mut self) {
        let entry = self.manifest.remove(&self.name).unwrap();
        self.manifest.insert("slow".to_owned(), entry);
    }

    /// Writes both into a folder of the world, and says which.
    pub(crate) fn write(&self, world: &World) -> PathBuf {
        let folder = world.folder().join("weights");
        fs::create_dir_all(&folder).unwrap();
        fs::write(folder.join("MANIFEST.toml"), self.manifest.to_string()).unwrap();
        fs::write(folder.join(&self.file), &self.content).unwrap();
        folder
    }
}
