//! The controller's settings (`config/controller.toml` says what each means).

use std::path::{Path, PathBuf};

use input_files::{SettingsError, SettingsFile};
use pcc_model::Robot;
use robot_driver::{ConfigError, check_loop, robot_of};

use crate::executive::{BeginWindow, ExecutiveSettings};

input_files::settings_file! {
    /// The settings of the file, with defaults for those that it leaves out.
    #[derive(Debug, PartialEq)]
    struct File {
        robot: PathBuf,
    }
    defaults {
        rate_hz: u32 = 1000,
        realtime_priority: u8 = 80,
        processor: i64 = -1,
        lock_memory: bool = true,
        step_cap_ms: f64 = 20.0,
        late_run_ms: u32 = 100,
        robot_lost_ms: u32 = 20,
        daemon_lost_ms: u32 = 200,
        tracking_filter_ms: f64 = 10.0,
        hold_tolerance_rad: f64 = 0.05,
        begin_past_ms: u32 = 100,
        begin_ahead_s: u32 = 60,
    }
}

/// Checked settings of the controller.
#[derive(Clone, Debug)]
pub struct ControllerConfig {
    /// The robot file's content.
    pub robot: Robot,
    /// Priority under SCHED_FIFO, `None` for none.
    pub realtime_priority: Option<u8>,
    /// Linux's number, from 0, of the processor that the loop runs on; `None` for any.
    pub processor: Option<usize>,
    /// Whether the process's pages are locked in memory.
    pub lock_memory: bool,
    /// Age of the daemon's last heartbeat at which it counts as lost, ns; `None` for never.
    pub daemon_lost_ns: Option<i64>,
    /// When a trajectory may begin.
    pub begin: BeginWindow,
    /// The state machine's thresholds.
    pub executive: ExecutiveSettings,
}

impl ControllerConfig {
    /// Reads and checks `path`; the robot file is looked up relative to the configuration's folder.
    ///
    /// # Errors
    /// [`ConfigError`] names the file, the setting and what is allowed.
    pub fn from_file(path: &Path) -> Result<Self, ConfigError> {
        let checked = SettingsFile { path };
        let file: File = checked.read()?;
        file.check(&checked)?;
        file.check_times(&checked)?;
        let robot = robot_of(&checked, &file.robot)?;
        Ok(Self {
            robot,
            realtime_priority: Some(file.realtime_priority).filter(|priority| *priority > 0),
            processor: usize::try_from(file.processor).ok(),
            lock_memory: file.lock_memory,
            daemon_lost_ns: Some(whole_ms(file.daemon_lost_ms)).filter(|limit_ns| *limit_ns > 0),
            begin: BeginWindow {
                past_ns: whole_ms(file.begin_past_ms),
                ahead_ns: whole_ms(file.begin_ahead_s) * 1_000,
            },
            executive: file.executive(),
        })
    }
}

impl File {
    fn check(&self, checked: &SettingsFile<'_>) -> Result<(), SettingsError> {
        check_loop(checked, self.rate_hz, self.realtime_priority)?;
        let processor = self.processor;
        let allowed = "-1 (any) or a processor's number";
        let holds = (-1..10_000).contains(&processor);
        checked.require(holds, "processor", processor, allowed)?;
        let tolerance = self.hold_tolerance_rad;
        let holds = tolerance > 0.0 && tolerance < 1.0;
        checked.require(holds, "hold_tolerance_rad", tolerance, "above 0, below 1")
    }

    fn check_times(&self, checked: &SettingsFile<'_>) -> Result<(), SettingsError> {
        let two_periods_ms = 2e3 / f64::from(self.rate_hz);
        checked.within("step_cap_ms", self.step_cap_ms, two_periods_ms..=100.0)?;
        checked.within("late_run_ms", self.late_run_ms, 10..=1000)?;
        checked.within("robot_lost_ms", self.robot_lost_ms, 5..=1000)?;
        let daemon = self.daemon_lost_ms;
        let holds = daemon == 0 || (40..=10_000).contains(&daemon);
        checked.require(holds, "daemon_lost_ms", daemon, "0 (never) or 40 to 10000")?;
        checked.within("tracking_filter_ms", self.tracking_filter_ms, 0.0..=1000.0)?;
        checked.within("begin_past_ms", self.begin_past_ms, 0..=1000)?;
        checked.within("begin_ahead_s", self.begin_ahead_s, 1..=3600)
    }

    fn executive(&self) -> ExecutiveSettings {
        #[expect(clippy::cast_possible_truncation, reason = "at most 100 ms")]
        let step_cap_ns = (self.step_cap_ms * 1e6) as i64;
        ExecutiveSettings {
            period_ns: 1_000_000_000 / i64::from(self.rate_hz),
            step_cap_ns,
            late_run_ns: whole_ms(self.late_run_ms),
            robot_lost_ns: whole_ms(self.robot_lost_ms),
            tracking_filter_s: self.tracking_filter_ms * 1e-3,
            hold_tolerance_rad: self.hold_tolerance_rad,
        }
    }
}

fn whole_ms(milliseconds: u32) -> i64 {
    i64::from(milliseconds) * 1_000_000
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn shipped() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/controller.toml")
    }

    /// The shipped file with `from` replaced by `to`, read as a configuration.
    fn changed(from: &str, to: &str) -> Result<ControllerConfig, ConfigError> {
        let text = fs::read_to_string(shipped()).unwrap();
        assert!(
            text.contains(from),
            "the premise: {from} is in the shipped file"
        );
        let robot = shipped().parent().unwrap().join("robots/unit.toml");
        let text = text
            .replace(from, to)
            .replace("robots/unit.toml", robot.to_str().unwrap());
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("controller.toml");
        fs::write(&path, text).unwrap();
        ControllerConfig::from_file(&path)
    }

    #[test]
    fn the_shipped_configuration_is_valid() {
        let config = ControllerConfig::from_file(&shipped()).unwrap();
        assert_eq!(config.executive.period_ns, 1_000_000);
        assert_eq!(config.robot.tendons.count(), 9);
        assert_eq!(config.processor, None);
    }

    #[test]
    fn the_shipped_values_are_the_defaults() {
        let shipped: File = toml::from_str(&fs::read_to_string(shipped()).unwrap()).unwrap();
        let bare: File = toml::from_str("robot = \"robots/unit.toml\"").unwrap();
        assert_eq!(shipped, bare);
    }

    #[test]
    fn zeros_switch_off_what_the_comments_say() {
        assert_eq!(
            changed("daemon_lost_ms = 200", "daemon_lost_ms = 0")
                .unwrap()
                .daemon_lost_ns,
            None
        );
        let none = changed("realtime_priority = 80", "realtime_priority = 0").unwrap();
        assert_eq!(none.realtime_priority, None);
    }

    #[test]
    fn every_bad_setting_is_named_with_what_is_allowed() {
        let cases = [
            (
                "rate_hz = 1000",
                "rate_hz = 5000",
                "rate_hz = 5000 is not allowed: 100 to 4000",
            ),
            (
                "realtime_priority = 80",
                "realtime_priority = 100",
                "realtime_priority = 100",
            ),
            ("processor = -1", "processor = -2", "processor = -2"),
            (
                "step_cap_ms = 20.0",
                "step_cap_ms = nan",
                "step_cap_ms = NaN",
            ),
            ("late_run_ms = 100", "late_run_ms = 0", "late_run_ms = 0"),
            (
                "robot_lost_ms = 20",
                "robot_lost_ms = 1",
                "robot_lost_ms = 1",
            ),
            (
                "daemon_lost_ms = 200",
                "daemon_lost_ms = 10",
                "0 (never) or 40 to 10000",
            ),
            (
                "hold_tolerance_rad = 0.05",
                "hold_tolerance_rad = 0.0",
                "hold_tolerance_rad = 0",
            ),
            (
                "begin_ahead_s = 60",
                "begin_ahead_s = 0",
                "begin_ahead_s = 0",
            ),
            (
                "rate_hz = 1000",
                "rate_hz = 1000\nrate = 3",
                "unknown field `rate`",
            ),
            ("robot = \"robots/unit.toml\"", "", "missing field `robot`"),
            ("rate_hz = 1000", "rate_hz = \"fast\"", "invalid type"),
            (
                "robot = \"robots/unit.toml\"",
                "robot = \"none.toml\"",
                "none.toml",
            ),
        ];
        for (from, to, expected) in cases {
            let error = changed(from, to).unwrap_err().to_string();
            assert!(error.contains(expected), "{to}: {error}");
            assert!(error.contains("controller.toml"), "{error}");
        }
        let error = ControllerConfig::from_file(Path::new("/nowhere/c.toml")).unwrap_err();
        assert!(error.to_string().contains("/nowhere/c.toml"), "{error}");
    }
}
