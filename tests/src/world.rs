//! A private place for one set of processes: services, configuration files, logs.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use pcc_model::{Robot, UnitRobot};
use shared_types::codes::Sampler;
use shared_types::ipc::IpcOptions;
use tempfile::TempDir;
use toml::{Table, Value};

use crate::brute_force::Body;
use crate::programs::repository;

/// Time of silence that [`Settings::patient`] lets pass, ms.
const PATIENT_MS: i64 = 100;

/// What a world has different from the shipped configuration.
#[derive(Clone, Debug, Default)]
pub struct Settings {
    /// The tendon limits are the unit robot's times this, if given: bulk tests use 10.
    pub limits_factor: Option<f64>,
    /// Everything happens so many times as fast, if given: velocity limits × this, acceleration × its square, jerk × its cube.
    pub time_factor: Option<f64>,
    /// Keys of the daemon's configuration.
    pub daemon: Vec<(&'static str, Value)>,
    /// Whether no process asks for a real-time priority, as if the system refused them.
    pub without_priorities: bool,
    /// Whether the daemon is to have no model.
    pub without_weights: bool,
    /// Time of silence after which the controller for the simulated robot, and a robot or a servo for the controller or the driver, is lost, ms, if
    /// not the shipped one; a cycle of the controller counts as much.
    pub lost_ms: Option<i64>,
}

impl Settings {
    /// Everything ten times as fast, with a tolerance for motors that lag four times as far behind.
    #[must_use]
    pub fn ten_times_as_fast() -> Self {
        Self {
            time_factor: Some(10.0),
            daemon: vec![("path_tolerance_rad", Value::Float(0.03))],
            ..Self::default()
        }
    }

    /// Limits ten times higher, so that motions are short.
    ///
    /// Whatever makes the robot late makes a tracking error ten times as large too: so is the tolerance, nearly twice over.
    #[must_use]
    pub fn fast_robot() -> Self {
        Self {
            limits_factor: Some(10.0),
            daemon: vec![("path_tolerance_rad", Value::Float(0.1))],
            ..Self::default()
        }
    }

    /// These for tests that are not about silence: a virtual machine can lose a processor for longer than the shipped times.
    #[must_use]
    pub fn patient(self) -> Self {
        Self {
            lost_ms: Some(PATIENT_MS),
            ..self
        }
    }
}

/// A prefix and a root of its own, and configuration files; everything is removed when dropped.
#[derive(Debug)]
pub struct World {
    /// Where its services are.
    pub options: IpcOptions,
    /// The robot that its configuration files name.
    pub robot: Robot,
    /// Whether its daemon has a model.
    pub has_weights: bool,
    /// [`Settings::lost_ms`].
    pub lost_ms: Option<i64>,
    folder: TempDir,
    logs: AtomicU32,
}

impl World {
    /// The robot in units of its section length.
    ///
    /// # Panics
    /// If its sections are not equally long.
    #[must_use]
    pub fn unit_robot(&self) -> UnitRobot {
        let unit_robot = self.robot.to_unit();
        unit_robot.expect("the robots of tests have equally long sections")
    }

    /// The robot's body, by the file that its processes read.
    #[must_use]
    pub fn body(&self) -> Body {
        let file = self.config("robots/unit.toml");
        Body::from_robot_file(&std::fs::read_to_string(file).unwrap())
    }

    /// Makes one.
    #[must_use]
    pub fn new(settings: &Settings) -> Self {
        let folder = tempfile::Builder::new()
            .prefix("pcct")
            .tempdir_in("/dev/shm")
            .unwrap();
        let prefix = folder.path().file_name().unwrap().to_str().unwrap();
        let options = IpcOptions {
            prefix: prefix.replace('.', "-"),
            root: folder.path().join("root"),
        };
        let has_weights = !settings.without_weights;
        let robot = write_configuration(&folder.path().join("config"), settings, has_weights);
        Self {
            options,
            robot,
            has_weights,
            lost_ms: settings.lost_ms,
            folder,
            logs: AtomicU32::new(0),
        }
    }

    /// A path of a configuration file.
    #[must_use]
    pub fn config(&self, name: &str) -> PathBuf {
        self.folder.path().join("config").join(name)
    }

    /// The folder that is removed with the world.
    #[must_use]
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// What its daemon proposes with: the model, or the null arm in a world that is to have none.
    #[must_use]
    pub fn sampler(&self) -> Sampler {
        if self.has_weights {
            Sampler::Default
        } else {
            Sampler::Straight
        }
    }

    /// Bytes in shared memory under this world's prefix and root, as the files' sizes.
    #[must_use]
    pub fn shared_memory_bytes(&self) -> u64 {
        let files = self.shared_files();
        let data = files.iter().filter_map(|file| fs::metadata(file).ok());
        data.filter(fs::Metadata::is_file).map(|it| it.len()).sum()
    }

    /// Files of the services, in `/dev/shm` those with this world's prefix, and all files and folders under its root.
    #[must_use]
    pub fn shared_files(&self) -> BTreeSet<PathBuf> {
        let mut files = BTreeSet::new();
        for entry in entries(Path::new("/dev/shm")) {
            let name = entry.file_name();
            let is_own = name.to_string_lossy().starts_with(&self.options.prefix);
            if is_own && entry.path().is_file() {
                files.insert(entry.path());
            }
        }
        add_files(&self.options.root, &mut files);
        files
    }

    pub(crate) fn new_log(&self, program: &str) -> PathBuf {
        let number = self.logs.fetch_add(1, Ordering::Relaxed);
        self.folder.path().join(format!("{program}-{number}.log"))
    }
}

impl Drop for World {
    /// What killed processes have left; nobody else uses this prefix.
    fn drop(&mut self) {
        for entry in entries(Path::new("/dev/shm")) {
            let name = entry.file_name();
            if name.to_string_lossy().starts_with(&self.options.prefix) && entry.path().is_file() {
                let _ = fs::remove_file(entry.path());
            }
        }
    }
}

/// The entries of a folder; none where it is gone.
fn entries(folder: &Path) -> impl Iterator<Item = fs::DirEntry> {
    fs::read_dir(folder).into_iter().flatten().flatten()
}

fn add_files(folder: &Path, files: &mut BTreeSet<PathBuf>) {
    for entry in entries(folder) {
        let path = entry.path();
        if path.is_dir() {
            add_files(&path, files);
        }
        files.insert(path);
    }
}

/// The key of the real-time priority in every configuration file.
pub const PRIORITY: &str = "realtime_priority";

/// Highest natural frequency of the simulated motors that the robot's program takes, rad/s.
const HIGHEST_FREQUENCY_RAD_S: f64 = 500.0;

/// A shipped configuration file as a table.
#[must_use]
pub fn shipped(name: &str) -> Table {
    let path = repository().join("config").join(name);
    fs::read_to_string(&path)
        .unwrap_or_else(|error| panic!("{}: {error}", path.display()))
        .parse()
        .unwrap()
}

/// A number of a shipped configuration file.
///
/// # Panics
/// Where the file has no such key, or its value is no number.
#[must_use]
pub fn shipped_number(name: &str, key: &str) -> f64 {
    let table = shipped(name);
    let value = &table[key];
    let number = value.as_float();
    #[expect(clippy::cast_precision_loss, reason = "settings are small")]
    let number = number.or_else(|| value.as_integer().map(|whole| whole as f64));
    number.unwrap_or_else(|| panic!("config/{name}: {key} = {value} is no number"))
}

fn write_configuration(folder: &Path, settings: &Settings, has_weights: bool) -> Robot {
    fs::create_dir_all(folder.join("robots")).unwrap();
    let mut robot = shipped("robots/unit.toml");
    if let Some(factor) = settings.time_factor {
        let limits = robot["tendon_limits"].as_table_mut().unwrap();
        for (key, power) in [
            ("velocity_m_s", 1),
            ("acceleration_m_s2", 2),
            ("jerk_m_s3", 3),
        ] {
            let faster = limits[key].as_float().unwrap() * factor.powi(power);
            limits.insert(key.to_owned(), Value::Float(faster));
        }
    }
    if let Some(factor) = settings.limits_factor {
        for (_, limit) in robot["tendon_limits"].as_table_mut().unwrap() {
            *limit = Value::Float(limit.as_float().unwrap() * factor);
        }
    }
    fs::write(folder.join("robots/unit.toml"), robot.to_string()).unwrap();
    let mut controller = shipped("controller.toml");
    if settings.without_priorities {
        controller.insert(PRIORITY.to_owned(), Value::Integer(0));
    }
    if let Some(lost_ms) = settings.lost_ms {
        controller.insert("robot_lost_ms".to_owned(), lost_ms.into());
        controller.insert("step_cap_ms".to_owned(), Value::Float(lost_ms as f64));
        controller.insert("late_run_ms".to_owned(), (5 * lost_ms).into());
    }
    fs::write(folder.join("controller.toml"), controller.to_string()).unwrap();
    let mut motors = shipped("simulated-robot.toml");
    // The lag behind an acceleration a is a/ω²: motors that keep up with faster motions as well as the shipped ones.
    let frequency = motors["natural_frequency_rad_s"].as_float().unwrap()
        * settings.limits_factor.unwrap_or(1.0).sqrt()
        * settings.time_factor.unwrap_or(1.0);
    let frequency = frequency.min(HIGHEST_FREQUENCY_RAD_S);
    motors.insert("natural_frequency_rad_s".into(), frequency.into());
    if settings.without_priorities {
        motors.insert(PRIORITY.to_owned(), Value::Integer(0));
    }
    if let Some(lost_ms) = settings.lost_ms {
        motors.insert("lost_setpoint_ms".to_owned(), lost_ms.into());
    }
    fs::write(folder.join("simulated-robot.toml"), motors.to_string()).unwrap();
    let mut daemon = shipped("planner-daemon.toml");
    daemon.remove("weights");
    if has_weights {
        let weights = repository().join("weights");
        daemon.insert("weights".into(), weights.to_str().unwrap().into());
    }
    for (key, value) in &settings.daemon {
        daemon.insert((*key).to_owned(), value.clone());
    }
    fs::write(folder.join("planner-daemon.toml"), daemon.to_string()).unwrap();
    Robot::from_toml_str(&robot.to_string(), Path::new("robot.toml")).unwrap()
}
