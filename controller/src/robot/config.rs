//! The simulated robot's settings (`config/simulated-robot.toml` says what each means).

use std::path::{Path, PathBuf};

use pcc_model::{Configuration, Robot};
use serde::Deserialize;

use super::{MotorLimits, ReferenceLimits, RememberedPose};
use crate::{
    TENDONS,
    config::{Checked, ConfigError},
};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    robot: PathBuf,
    rate_hz: u32,
    realtime_priority: u8,
    lost_setpoint_ms: u32,
    limit_allowance: f64,
    motor_margin: f64,
    natural_frequency_rad_s: f64,
    backlash: f64,
    noise: f64,
    seed: u64,
    start_configuration_rad: [f64; 6],
    remembers_pose: bool,
    stuck_tendon: usize,
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
    /// What each motor can do.
    pub motor: MotorLimits,
    /// What the reference may do.
    pub reference: ReferenceLimits,
}

impl RobotConfig {
    /// Reads and checks `path`; the robot file is looked up relative to the configuration's folder.
    ///
    /// # Errors
    /// [`ConfigError`] names the file, the setting and what is allowed.
    pub fn from_file(path: &Path) -> Result<Self, ConfigError> {
        let checked = Checked { path };
        let file: File = checked.read()?;
        file.check(&checked)?;
        let robot = checked.robot(&file.robot)?;
        file.check_robot(&checked, &robot)?;
        Ok(Self {
            period_ns: 1_000_000_000 / i64::from(file.rate_hz),
            realtime_priority: Some(file.realtime_priority).filter(|priority| *priority > 0),
            seed: file.seed,
            start_configuration_rad: Configuration::from(file.start_configuration_rad),
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
    pub fn start_pose(&self) -> RememberedPose {
        let mut position_m = [0.0; TENDONS];
        let count = self.robot.tendons.count();
        self.robot
            .tendons
            .lengths(&self.start_configuration_rad, &mut position_m[..count]);
        RememberedPose {
            position_m,
            velocity_m_s: [0.0; TENDONS],
        }
    }
}

impl File {
    fn check(&self, checked: &Checked<'_>) -> Result<(), ConfigError> {
        checked.real_time_loop(self.rate_hz, self.realtime_priority)?;
        checked.within("lost_setpoint_ms", self.lost_setpoint_ms, 5.0..=1000.0)?;
        checked.within("limit_allowance", self.limit_allowance, 1.0..=2.0)?;
        checked.within("motor_margin", self.motor_margin, 1.0..=10.0)?;
        let name = "natural_frequency_rad_s";
        checked.within(name, self.natural_frequency_rad_s, 1.0..=500.0)?;
        checked.within("backlash", self.backlash, 0.0..=0.01)?;
        checked.within("noise", self.noise, 0.0..=0.01)
    }

    fn check_robot(&self, checked: &Checked<'_>, robot: &Robot) -> Result<(), ConfigError> {
        let start = Configuration::from(self.start_configuration_rad);
        let excess = robot.limit_excess(&start);
        let name = "largest bending angle of start_configuration_rad";
        let allowed = "within the robot's bending limit";
        checked.require(excess <= 0.0, name, robot.bending_limit + excess, allowed)?;
        #[expect(clippy::cast_precision_loss, reason = "a tendon's number is small")]
        let stuck = self.stuck_tendon as f64;
        let allowed = "a tendon of the robot, counted from 0";
        checked.require(
            self.stuck_tendon < robot.tendons.count(),
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
        }
    }
}
