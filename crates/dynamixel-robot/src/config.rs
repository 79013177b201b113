//! The driver's settings (`config/dynamixel-robot.toml` says what each means).

use std::path::{Path, PathBuf};
use std::time::Duration;

use input_files::{SettingsError, SettingsFile};
use pcc_model::Robot;
use robot_driver::{ConfigError, robot_of};

use crate::registers::{MILLIAMPERES, WATCHDOG_MS};

/// Ids that a servo can have.
const IDS: std::ops::RangeInclusive<u8> = 0..=252;

input_files::settings_file! {
    /// The settings of the file, with defaults for those that it leaves out.
    #[derive(Debug, PartialEq)]
    struct File {
        robot: PathBuf,
        device: PathBuf,
        servo_ids: Vec<u8>,
        directions: Vec<i8>,
    }
    defaults {
        baud: u32 = 4_000_000,
        rate_hz: u32 = 1000,
        realtime_priority: u8 = 70,
        home: PathBuf = PathBuf::from("dynamixel-robot.home.toml"),
        current_limit_ma: f64 = 1000.0,
        pre_tension_ma: f64 = 100.0,
        slack_ma: f64 = 20.0,
        bus_watchdog_ms: u32 = 20,
        silent_ms: u32 = 20,
        lag_ms: f64 = 0.0,
        home_speed_rpm: f64 = 5.0,
        home_turns: f64 = 3.0,
        home_timeout_s: f64 = 30.0,
    }
}

/// Checked settings.
#[derive(Clone, Debug)]
pub struct DynamixelConfig {
    /// The robot file's content.
    pub robot: Robot,
    /// The serial line.
    pub(crate) device: PathBuf,
    /// Its speed, bit/s.
    pub(crate) baud: u32,
    /// The servo of each tendon.
    pub(crate) servo_ids: Vec<u8>,
    /// 1 where a tendon gets longer while its servo's position grows, -1 where it gets shorter.
    pub(crate) directions: Vec<i8>,
    /// Length of a cycle.
    pub(crate) period: Duration,
    /// Priority under SCHED_FIFO, `None` for none.
    pub(crate) realtime_priority: Option<u8>,
    /// Where homing notes the positions of the straight robot.
    pub(crate) home: PathBuf,
    /// Torque limit, in the servos' units of current.
    pub(crate) current_limit: u16,
    /// Current of a tendon that is tense when the robot is straight.
    pub(crate) pre_tension: u16,
    /// Current below which a tendon is slack.
    pub(crate) slack: u16,
    /// The servos' own watchdog, in its units; 0: none.
    pub(crate) bus_watchdog: u8,
    /// Time of the driver's cycles without an answer after which a servo counts as silent.
    pub(crate) silent_after: Duration,
    /// Time by which a servo is behind a goal that moves, s: goals are sent so much ahead.
    pub(crate) lag_s: f64,
    /// How homing winds tendons.
    pub(crate) homing: Homing,
}

/// How homing winds tendons.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Homing {
    /// Turns a minute.
    pub(crate) speed_rpm: f64,
    /// Turns that a tendon is wound at most.
    pub(crate) turns: f64,
    /// Time that homing may take.
    pub(crate) timeout: Duration,
}

impl DynamixelConfig {
    /// Reads and checks `path`; the files that it names are looked up relative to its folder.
    ///
    /// # Errors
    /// [`ConfigError`] names the file, the setting and what is allowed.
    pub fn from_file(path: &Path) -> Result<Self, ConfigError> {
        let checked = SettingsFile { path };
        let file: File = checked.read()?;
        file.check(&checked)?;
        let robot = robot_of(&checked, &file.robot)?;
        file.check_tendons(&checked, robot.tendons.count())?;
        let units = |milliamperes: f64| (milliamperes / MILLIAMPERES).round() as u16;
        Ok(Self {
            robot,
            device: file.device,
            baud: file.baud,
            servo_ids: file.servo_ids,
            directions: file.directions,
            period: Duration::from_secs(1) / file.rate_hz,
            realtime_priority: Some(file.realtime_priority).filter(|it| *it > 0),
            home: path.with_file_name(file.home),
            current_limit: units(file.current_limit_ma),
            pre_tension: units(file.pre_tension_ma),
            slack: units(file.slack_ma),
            bus_watchdog: (file.bus_watchdog_ms / WATCHDOG_MS) as u8,
            silent_after: Duration::from_millis(file.silent_ms.into()),
            lag_s: 1e-3 * file.lag_ms,
            homing: Homing {
                speed_rpm: file.home_speed_rpm,
                turns: file.home_turns,
                timeout: Duration::from_secs_f64(file.home_timeout_s),
            },
        })
    }
}

impl File {
    fn check(&self, checked: &SettingsFile<'_>) -> Result<(), SettingsError> {
        checked.within("baud", self.baud, 9_600..=4_500_000)?;
        checked.within("rate_hz", self.rate_hz, 50..=4000)?;
        checked.within("realtime_priority", self.realtime_priority, 0..=99)?;
        checked.within("current_limit_ma", self.current_limit_ma, 10.0..=3200.0)?;
        let most = self.current_limit_ma;
        checked.within("pre_tension_ma", self.pre_tension_ma, 5.0..=most)?;
        checked.within("slack_ma", self.slack_ma, 0.0..=self.pre_tension_ma)?;
        checked.within("bus_watchdog_ms", self.bus_watchdog_ms, 0..=2540)?;
        let steps = self.bus_watchdog_ms.is_multiple_of(WATCHDOG_MS);
        let allowed = "a multiple of 20, the servos' own step";
        checked.require(steps, "bus_watchdog_ms", self.bus_watchdog_ms, allowed)?;
        checked.within("silent_ms", self.silent_ms, 5..=1000)?;
        checked.within("lag_ms", self.lag_ms, 0.0..=100.0)?;
        checked.within("home_speed_rpm", self.home_speed_rpm, 0.3..=60.0)?;
        checked.within("home_turns", self.home_turns, 0.1..=100.0)?;
        checked.within("home_timeout_s", self.home_timeout_s, 1.0..=600.0)
    }

    fn check_tendons(
        &self,
        checked: &SettingsFile<'_>,
        tendons: usize,
    ) -> Result<(), SettingsError> {
        let ids = &self.servo_ids;
        let a_servo_each = format!("{tendons} ids, one for each tendon of the robot file");
        let text = format!("{ids:?}");
        checked.require(ids.len() == tendons, "servo_ids", &text, a_servo_each)?;
        let once = |(index, id): (usize, &u8)| IDS.contains(id) && !ids[..index].contains(id);
        let differ = ids.iter().enumerate().all(once);
        checked.require(differ, "servo_ids", &text, "ids of 0 to 252, each once")?;
        let directions = &self.directions;
        let known = directions.iter().all(|it| [1, -1].contains(it));
        let text = format!("{directions:?}");
        let allowed = format!("{tendons} times 1 or -1");
        let fit = known && directions.len() == tendons;
        checked.require(fit, "directions", text, allowed)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use std::fs;

    fn shipped() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/dynamixel-robot.toml")
    }

    #[test]
    fn the_shipped_values_are_the_defaults() {
        let shipped: File = toml::from_str(&fs::read_to_string(shipped()).unwrap()).unwrap();
        let bare = "robot = \"robots/unit.toml\"\ndevice = \"/dev/ttyUSB0\"\n\
                    servo_ids = [1, 2, 3, 4, 5, 6, 7, 8, 9]\ndirections = [1, 1, 1, 1, 1, 1, 1, 1, 1]";
        assert_eq!(shipped, toml::from_str(bare).unwrap());
    }

    #[test]
    fn servos_that_do_not_fit_the_robot_are_refused_by_name() {
        let robot = shipped().parent().unwrap().join("robots/unit.toml");
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("dynamixel-robot.toml");
        let nine = "[1, 1, 1, 1, 1, 1, 1, 1, 1]";
        let counted = "[1, 2, 3, 4, 5, 6, 7, 8, 9]";
        for (ids, directions, more, named) in [
            ("[1, 2]", nine, "", "9 ids, one for each tendon"),
            (nine, nine, "", "ids of 0 to 252, each once"),
            (counted, "[1]", "", "9 times 1 or -1"),
            (
                counted,
                "[1, 1, 1, 1, 0, 1, 1, 1, 1]",
                "",
                "9 times 1 or -1",
            ),
            (counted, nine, "bus_watchdog_ms = 30", "a multiple of 20"),
            (counted, nine, "pre_tension_ma = 2000.0", "5 to 1000"),
            (counted, nine, "baud = 12", "9600 to 4500000"),
        ] {
            let text = format!(
                "robot = {robot:?}\ndevice = \"/dev/null\"\nservo_ids = {ids}\ndirections = {directions}\n{more}\n"
            );
            fs::write(&path, text).unwrap();
            let error = DynamixelConfig::from_file(&path).unwrap_err().to_string();
            assert!(error.contains(named), "{named}: {error}");
        }
    }
}
