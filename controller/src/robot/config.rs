//! The simulated robot's settings (`config/simulated-robot.toml` says what each means).

use std::path::{Path, PathBuf};
use std::time::Duration;

use input_files::{SettingsError, SettingsFile};
use pcc_model::{Configuration, DOF, Numbers, Robot};
use robot_driver::{
    ConfigError, ReferenceLimits, TendonState, check_loop, longest_cycle_ns, robot_of,
};

use super::MotorLimits;
use crate::TENDONS;

input_files::settings_file! {
    /// The settings of the file, with defaults for those that it leaves out.
    #[derive(Debug, PartialEq)]
    struct File {
        robot: PathBuf,
    }
    defaults {
        rate_hz: u32 = 1000,
        realtime_priority: u8 = 70,
        lost_setpoint_ms: u32 = 20,
        limit_allowance: f64 = 1.05,
        motor_margin: f64 = 1.5,
        natural_frequency_rad_s: f64 = 100.0,
        backlash: f64 = 1e-4,
        noise: f64 = 2e-5,
        seed: u64 = 1,
        start_configuration_rad: Numbers<DOF> = Numbers([0.0; DOF]),
        remembers_pose: bool = true,
        stuck_tendon: usize = 4,
    }
}

/// Checked settings of the simulated robot, in SI units.
#[derive(Clone, Debug)]
pub struct RobotConfig {
    /// The robot file's content.
    pub robot: Robot,
    /// Length of a cycle, ns.
    pub period_ns: i64,
    /// Priority under SCHED_FIFO, `None` for none.
    pub realtime_priority: Option<u8>,
    /// Seed of the measurement noise.
    pub seed: u64,
    /// Where a robot that remembers nothing begins, rad.
    pub start_configuration_rad: Configuration,
    /// Whether the pose survives a killed process.
    pub remembers_pose: bool,
    /// The tendon (0-based) whose motor sticks when that fault is injected.
    pub stuck_tendon: usize,
    /// Standard deviation of a measured tendon length, m.
    pub noise_m: f64,
    /// Limits and properties of each motor.
    pub motor: MotorLimits,
    /// Limits of the reference.
    pub reference: ReferenceLimits,
}

impl RobotConfig {
    /// Reads and checks `path`; the robot file is looked up relative to the configuration's folder.
    ///
    /// # Errors
    /// [`ConfigError`] names the file, the setting and what is allowed.
    pub fn from_file(path: &Path) -> Result<Self, ConfigError> {
        let checked = SettingsFile { path };
        let file: File = checked.read()?;
        file.check(&checked)?;
        let robot = robot_of(&checked, &file.robot)?;
        file.check_robot(&checked, &robot)?;
        Ok(Self {
            period_ns: 1_000_000_000 / i64::from(file.rate_hz),
            realtime_priority: Some(file.realtime_priority).filter(|priority| *priority > 0),
            seed: file.seed,
            start_configuration_rad: Configuration::from(file.start_configuration_rad.0),
            remembers_pose: file.remembers_pose,
            stuck_tendon: file.stuck_tendon,
            noise_m: file.noise * robot.section_lengths[0],
            motor: file.motor_limits(&robot),
            reference: file.reference_limits(&robot),
            robot,
        })
    }

    /// The pose of a robot that remembers nothing: the start configuration at rest.
    #[must_use]
    pub fn start_pose(&self) -> TendonState {
        let mut position_m = [0.0; TENDONS];
        let count = self.robot.tendons.count();
        self.robot
            .tendons
            .lengths(&self.start_configuration_rad, &mut position_m[..count]);
        TendonState {
            position_m,
            velocity_m_s: [0.0; TENDONS],
        }
    }
}

impl File {
    fn check(&self, checked: &SettingsFile<'_>) -> Result<(), SettingsError> {
        check_loop(checked, self.rate_hz, self.realtime_priority)?;
        checked.within("lost_setpoint_ms", self.lost_setpoint_ms, 5..=1000)?;
        checked.within("limit_allowance", self.limit_allowance, 1.0..=2.0)?;
        checked.within("motor_margin", self.motor_margin, 1.0..=10.0)?;
        let name = "natural_frequency_rad_s";
        checked.within(name, self.natural_frequency_rad_s, 1.0..=500.0)?;
        checked.within("backlash", self.backlash, 0.0..=0.01)?;
        checked.within("noise", self.noise, 0.0..=0.01)
    }

    fn check_robot(&self, checked: &SettingsFile<'_>, robot: &Robot) -> Result<(), SettingsError> {
        let start = self.start_configuration_rad.0;
        let limit = robot.bending_limit;
        if let Some(angle) = start
            .iter()
            .find(|angle| !(-limit..=limit).contains(*angle))
        {
            let allowed = format!("finite angles within ±{limit}, the robot's bending limit");
            checked.require(false, "start_configuration_rad", angle, allowed)?;
        }
        let start = Configuration::from(start);
        let excess = robot.limit_excess(&start);
        let name = "largest bending angle of start_configuration_rad";
        let allowed = format!("at most {limit}, the robot's bending limit");
        checked.require(excess <= 0.0, name, limit + excess, allowed)?;
        let stuck = self.stuck_tendon;
        let allowed = "a tendon of the robot, counted from 0";
        checked.require(
            stuck < robot.tendons.count(),
            "stuck_tendon",
            stuck,
            allowed,
        )
    }

    fn motor_limits(&self, robot: &Robot) -> MotorLimits {
        MotorLimits {
            velocity_m_s: robot.tendon_limits.velocity * self.motor_margin,
            acceleration_m_s2: robot.tendon_limits.acceleration * self.motor_margin,
            natural_frequency_rad_s: self.natural_frequency_rad_s,
            backlash_m: self.backlash * robot.section_lengths[0],
        }
    }

    fn reference_limits(&self, robot: &Robot) -> ReferenceLimits {
        ReferenceLimits {
            velocity_m_s: robot.tendon_limits.velocity,
            acceleration_m_s2: robot.tendon_limits.acceleration,
            allowance: self.limit_allowance,
            lost_after_ns: i64::from(self.lost_setpoint_ms) * 1_000_000,
            longest_cycle_ns: longest_cycle_ns(Duration::from_secs(1) / self.rate_hz),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn shipped() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/simulated-robot.toml")
    }

    #[test]
    fn the_shipped_values_are_the_defaults() {
        let shipped: File = toml::from_str(&fs::read_to_string(shipped()).unwrap()).unwrap();
        let bare: File = toml::from_str("robot = \"robots/unit.toml\"").unwrap();
        assert_eq!(shipped, bare);
    }

    #[test]
    fn a_start_of_seven_angles_or_of_none_is_refused_by_its_name_and_value() {
        let robot = shipped().parent().unwrap().join("robots/unit.toml");
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("simulated-robot.toml");
        for (start, named) in [
            (
                "[0, 0, 0, 0, 0, 0, 1]",
                "invalid length 7, expected an array of exactly 6",
            ),
            (
                "[0.0, nan, 0.0, 0.0, 0.0, 0.0]",
                "start_configuration_rad = NaN",
            ),
            (
                "[0.0, inf, 0.0, 0.0, 0.0, 0.0]",
                "start_configuration_rad = inf",
            ),
            (
                "[0.0, 2.0, 0.0, 0.0, 0.0, 0.0]",
                "start_configuration_rad = 2 is not allowed",
            ),
            (
                "[0.0, 0.0, 0.0, 0.0, 0.0, -1e300]",
                "start_configuration_rad = -1000000",
            ),
            (
                "[1.5, 1.5, 0.0, 0.0, 0.0, 0.0]",
                "largest bending angle of start_configuration_rad = 2.12",
            ),
        ] {
            let text = format!("robot = {robot:?}\nstart_configuration_rad = {start}\n");
            fs::write(&path, text).unwrap();
            let error = RobotConfig::from_file(&path).unwrap_err().to_string();
            assert!(error.contains(named), "{start}: {error}");
        }
    }
}
