//! Homing: where the servos are while the robot is straight.

use std::fs;
use std::io;
use std::path::PathBuf;
use std::thread::sleep;
use std::time::{Duration, Instant};

use input_files::{SettingsError, SettingsFile};
use serde::Serialize;
use shared_types::clock::mono_now_ns;
use shared_types::ipc::{IpcError, IpcOptions, Role, RoleLock};

use crate::bus::{BusError, ServoBus, ServoState};
use crate::config::DynamixelConfig;
use crate::registers::{
    BUS_WATCHDOG, CURRENT_BASED_POSITION, CURRENT_LIMIT, GOAL_CURRENT, OPERATING_MODE,
    PROFILE_VELOCITY, PULSES_OF_A_TURN, RETURN_DELAY_TIME, RPM, SCRATCH, TORQUE_ENABLE,
};

/// Time between two looks at the servos.
const LOOK: Duration = Duration::from_millis(20);
/// Looks during which a tense tendon stands still.
const STILL_LOOKS: u32 = 15;
/// Share of the pre-tension from which on a tendon that stands still is tense.
const TENSE: f64 = 0.8;
/// Velocity of a servo that stands still, in its units.
const STILL: i32 = 1;
/// The servos' watchdog while they wind, in its units of 20 ms: they stop where nobody looks at them any more.
const WINDING_WATCHDOG: u8 = 10;
/// How often all servos are told to let go, which none confirms.
const LETS_GO: usize = 3;
/// Pulses before the end of what may be wound within which a tendon has been wound as far as it may.
const AT_THE_END: i32 = 20;

/// Why the robot has no home.
#[derive(Debug, thiserror::Error)]
pub enum HomeError {
    /// Another process has the robot's place, or it cannot be taken.
    #[error(transparent)]
    Ipc(#[from] IpcError),
    /// The servos do not do what they are told.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// A servo gave up.
    #[error(
        "servo {id} is in error: hardware error status {status:#010b} (e-manual, address 70); the torque is off"
    )]
    InError {
        /// The servo's id.
        id: u8,
        /// What its hardware error status says.
        status: u8,
    },
    /// A tendon has been wound as far as it may and is not tense.
    #[error(
        "the tendon of servo {id} was wound by {turns} turns and is not tense: is it attached, and its direction right? The torque is off"
    )]
    Loose {
        /// The servo's id.
        id: u8,
        /// Turns that it was wound.
        turns: f64,
    },
    /// Some tendons were not tense in time.
    #[error("not tense within {within_s} s: the tendons of servos {ids:?}; the torque is off")]
    TimedOut {
        /// The servos' ids.
        ids: Vec<u8>,
        /// How long was waited, s.
        within_s: f64,
    },
    /// What was found cannot be noted.
    #[error("cannot write {path:?}: {source}")]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
}

/// What homing found, as its file has it.
#[derive(Debug, Serialize)]
pub(crate) struct Home {
    /// The mark that was left in each servo.
    pub(crate) mark: u32,
    /// Hash of the robot file that was homed, in hexadecimal.
    pub(crate) robot_hash: String,
    /// The servo of each tendon, and its direction.
    pub(crate) servo_ids: Vec<u8>,
    pub(crate) directions: Vec<i8>,
    /// Positions of the servos of the straight robot, pulses.
    pub(crate) zeros: Vec<i32>,
}

input_files::settings_file! {
    struct HomeFile {
        mark: u32,
        robot_hash: String,
        servo_ids: Vec<u8>,
        directions: Vec<i8>,
        zeros: Vec<i32>,
    }
    defaults {}
}

impl Home {
    /// What the last homing found.
    ///
    /// # Errors
    /// [`SettingsError`], also where it is another robot's, or was found with other servos or directions.
    pub(crate) fn read(config: &DynamixelConfig) -> Result<Self, SettingsError> {
        let file = SettingsFile { path: &config.home };
        let HomeFile {
            mark,
            robot_hash,
            servo_ids,
            directions,
            zeros,
        } = file.read()?;
        let own = hash_of(config);
        let allowed = format!("{own}, that of the robot file: home this robot");
        file.require(robot_hash == own, "robot_hash", &robot_hash, allowed)?;
        let allowed = format!("{:?}, those of the driver's file", config.servo_ids);
        let fits = servo_ids == config.servo_ids;
        file.require(fits, "servo_ids", format!("{servo_ids:?}"), allowed)?;
        let allowed = format!("{:?}, those of the driver's file", config.directions);
        let fits = directions == config.directions;
        file.require(fits, "directions", format!("{directions:?}"), allowed)?;
        let count = config.servo_ids.len();
        let allowed = format!("{count} positions");
        file.require(zeros.len() == count, "zeros", format!("{zeros:?}"), allowed)?;
        Ok(Self {
            mark,
            robot_hash,
            servo_ids,
            directions,
            zeros,
        })
    }

    fn write(&self, config: &DynamixelConfig) -> Result<(), HomeError> {
        let failed = |source| HomeError::Write {
            path: config.home.clone(),
            source,
        };
        let text = toml::to_string(self).map_err(|error| failed(io::Error::other(error)))?;
        let unfinished = config.home.with_extension("new");
        fs::write(&unfinished, text).map_err(failed)?;
        fs::rename(&unfinished, &config.home).map_err(failed)
    }
}

fn hash_of(config: &DynamixelConfig) -> String {
    format!("{:016x}", config.robot.hash())
}

/// Winds the tendons of the straight robot to their pre-tension and notes where the servos are; they then hold that with the torque limit.
///
/// # Errors
/// [`HomeError`]; the torque is then off as far as the servos can be reached.
pub fn home(config: &DynamixelConfig, options: &IpcOptions) -> Result<(), HomeError> {
    let _role = RoleLock::acquire(options, Role::Robot)?;
    let mut bus = ServoBus::open(&config.device, config.baud, &config.servo_ids)?;
    bus.find_all()?;
    let homed = wind(&mut bus, config).and_then(|zeros| note(&mut bus, config, zeros));
    if homed.is_err() {
        // Each by itself would end at the first one that does not answer.
        for _ in 0..LETS_GO {
            let _ = bus.set_all_u8(TORQUE_ENABLE, 0);
        }
    }
    homed
}

/// Leaves a mark in the servos, which then hold with the torque limit, and notes it with these positions.
fn note(bus: &mut ServoBus, config: &DynamixelConfig, zeros: Vec<i32>) -> Result<(), HomeError> {
    bus.set_u16(GOAL_CURRENT, config.current_limit)?;
    let mark = (mono_now_ns() as u32).max(1);
    bus.set_u32(SCRATCH, mark)?;
    let home = Home {
        mark,
        robot_hash: hash_of(config),
        servo_ids: config.servo_ids.clone(),
        directions: config.directions.clone(),
        zeros,
    };
    home.write(config)
}

/// Winds all tendons until they are tense; the positions then, pulses, which are held.
fn wind(bus: &mut ServoBus, config: &DynamixelConfig) -> Result<Vec<i32>, HomeError> {
    bus.set_u8(BUS_WATCHDOG, 0)?;
    bus.set_u8(TORQUE_ENABLE, 0)?;
    bus.set_u8(OPERATING_MODE, CURRENT_BASED_POSITION)?;
    bus.set_u8(RETURN_DELAY_TIME, 0)?;
    bus.set_u16(CURRENT_LIMIT, config.current_limit)?;
    bus.set_u32(
        PROFILE_VELOCITY,
        (config.homing.speed_rpm / RPM).ceil() as u32,
    )?;
    bus.set_u16(GOAL_CURRENT, config.pre_tension)?;
    let begun = look(bus)?;
    let most = (config.homing.turns * PULSES_OF_A_TURN) as i32;
    let ends = begun.iter().zip(&config.directions);
    let ends: Vec<i32> = ends
        .map(|(state, direction)| state.position - i32::from(*direction) * most)
        .collect();
    bus.set_u8(TORQUE_ENABLE, 1)?;
    bus.set_u8(BUS_WATCHDOG, WINDING_WATCHDOG)?;
    bus.send_goals(&ends)?;
    let zeros = wait_until_tense(bus, config, &ends)?;
    bus.set_u8(BUS_WATCHDOG, 0)?;
    // Confirmed: a servo that still went to the end would pull there with the torque limit.
    bus.set_goals(&zeros)?;
    Ok(zeros)
}

fn wait_until_tense(
    bus: &mut ServoBus,
    config: &DynamixelConfig,
    ends: &[i32],
) -> Result<Vec<i32>, HomeError> {
    let deadline = Instant::now() + config.homing.timeout;
    let tense = (TENSE * f64::from(config.pre_tension)) as u16;
    let mut still = vec![0; ends.len()];
    loop {
        sleep(LOOK);
        let states = look(bus)?;
        for (tendon, state) in states.iter().enumerate() {
            if state.is_in_error {
                let (id, status) = (bus.id(tendon), bus.hardware_error(tendon)?);
                return Err(HomeError::InError { id, status });
            }
            let is_tense = state.current.unsigned_abs() >= tense && state.velocity.abs() <= STILL;
            still[tendon] = if is_tense { still[tendon] + 1 } else { 0 };
            if !is_tense && (state.position - ends[tendon]).abs() <= AT_THE_END {
                let (id, turns) = (bus.id(tendon), config.homing.turns);
                return Err(HomeError::Loose { id, turns });
            }
        }
        if still.iter().all(|looks| *looks >= STILL_LOOKS) {
            return Ok(states.iter().map(|state| state.position).collect());
        }
        if Instant::now() > deadline {
            let not_tense = (0..still.len()).filter(|tendon| still[*tendon] < STILL_LOOKS);
            return Err(HomeError::TimedOut {
                ids: not_tense.map(|tendon| bus.id(tendon)).collect(),
                within_s: config.homing.timeout.as_secs_f64(),
            });
        }
    }
}

/// The states of all servos.
fn look(bus: &mut ServoBus) -> Result<Vec<ServoState>, BusError> {
    bus.all_states(Instant::now() + Duration::from_millis(500))
}
