//! Daemon and controller, and a driver of a bank of servos in the simulated robot's place.

use std::time::Duration;

use shared_types::codes::LoopState;

use crate::process::{Process, TimedOut, wait_for};
use crate::servo_bank::ServoBank;
use crate::stack::{PATIENCE, Part, Stack};
use crate::world::{Settings, World};

/// Speed of the line, bit/s.
pub const BAUD: u32 = 4_000_000;
/// How long homing may take.
const HOMED_WITHIN: Duration = Duration::from_secs(60);

/// A bank of servos for the robot of a world, and the configuration that names its line.
///
/// # Panics
/// Where the configuration cannot be written.
#[must_use]
pub fn bank(world: &World, baud: u32) -> ServoBank {
    let slack_m = std::array::from_fn(|k| 0.002 * (k + 1) as f64);
    let bank = ServoBank::start(&world.body(), world.robot.spool_radius, baud, slack_m);
    let config = world.config("dynamixel-robot.toml");
    bank.write_config(&config, &world.config("robots/unit.toml"), world.lost_ms);
    bank
}

/// Starts a program with the servos' configuration.
///
/// # Panics
/// Where its path is no text.
#[must_use]
pub fn start(world: &World, name: &str, before: &[&str]) -> Process {
    let config = world.config("dynamixel-robot.toml");
    let mut arguments = before.to_vec();
    arguments.extend(["--config", config.to_str().unwrap()]);
    Process::start(world, name, &arguments)
}

/// Homes the servos of a world; whether that went well, and what was said.
///
/// # Errors
/// Where it does not end.
pub fn home(world: &World) -> Result<(bool, String), TimedOut> {
    let mut homing = start(world, "pcc", &["home"]);
    let status = homing.wait(HOMED_WITHIN)?;
    Ok((status.success(), homing.log()))
}

/// A stack whose robot is a bank of servos.
pub struct ServoStack {
    /// `dynamixel-robot`.
    pub driver: Process,
    /// The servos.
    pub bank: ServoBank,
    /// Daemon and controller, whose world is that of all.
    pub stack: Stack,
}

impl ServoStack {
    /// Servos that were homed, and everything that drives them; holding.
    ///
    /// # Errors
    /// Where something does not come up in time.
    ///
    /// # Panics
    /// Where the servos cannot be homed.
    pub fn driven(settings: &Settings) -> Result<Self, TimedOut> {
        let mut stack = Stack::new(settings);
        let bank = bank(&stack.world, BAUD);
        let (is_homed, said) = home(&stack.world)?;
        assert!(is_homed, "{said}");
        let driver = start(&stack.world, "dynamixel-robot", &[]);
        stack.start(Part::Daemon);
        stack.start(Part::Controller);
        let mut all = Self {
            driver,
            bank,
            stack,
        };
        all.hold()?;
        Ok(all)
    }

    /// Waits until the robot is held.
    ///
    /// # Errors
    /// [`TimedOut`].
    pub fn hold(&mut self) -> Result<(), TimedOut> {
        let stack = &mut self.stack;
        wait_for("the robot is held", PATIENCE, || {
            let state = stack.controller.latest_state().ok().flatten()?;
            (state.state == LoopState::Holding).then_some(())
        })
    }
}
