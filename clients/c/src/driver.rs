//! Driving a robot's motors.

use std::ffi::c_char;
use std::mem::offset_of;

use client::ClientError;
use robot_driver::{DriverSettings, RobotConnection, RobotDriver, TENDONS, TendonState};
use shared_types::codes::{MotorFault, UnknownCode};

use crate::error::{Failure, Outcome, or_fail};
use crate::pointer::{array, free, give, options, read, robot, write};

/// The driver of a robot's motors; it has the robot's place.
pub struct Driver(RobotDriver);

/// What motors are to do in a cycle: lengths of the tendons relative to the straight robot, those beyond the robot's tendons 0.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct MotorTargets {
    /// Time for which this is, nanoseconds of CLOCK_MONOTONIC.
    pub stamp_ns: i64,
    /// Metres.
    pub position_m: [f64; 9],
    /// Metres a second.
    pub velocity_m_s: [f64; 9],
    /// Metres a second squared.
    pub acceleration_m_s2: [f64; 9],
}

const _: () = assert!(TENDONS == 9, "as the header says");

// The header has the same, written from cbindgen.toml.
const _: () = {
    assert!(size_of::<MotorTargets>() == 224);
    assert!(offset_of!(MotorTargets, stamp_ns) == 0);
    assert!(offset_of!(MotorTargets, position_m) == 8);
    assert!(offset_of!(MotorTargets, velocity_m_s) == 80);
    assert!(offset_of!(MotorTargets, acceleration_m_s2) == 152);
};

impl From<robot_driver::MotorTargets> for MotorTargets {
    fn from(targets: robot_driver::MotorTargets) -> Self {
        Self {
            stamp_ns: targets.stamp_ns,
            position_m: targets.position_m,
            velocity_m_s: targets.velocity_m_s,
            acceleration_m_s2: targets.acceleration_m_s2,
        }
    }
}

/// Takes the robot's place for the robot of a robot file, whose motors stand at `position_m` (9 lengths of the tendons relative to the straight
/// robot, metres; null: all 0). A cycle is 1 ms. Null where it fails, also where another driver is there.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_driver_connect(
    prefix: *const c_char,
    root: *const c_char,
    robot_file: *const c_char,
    position_m: *const f64,
) -> *mut Driver {
    let connect = || {
        let robot = robot(robot_file)?;
        let state = motors(position_m)?;
        let settings = DriverSettings::of(&robot);
        let connection = RobotConnection::open(&options(prefix, root)?, &robot, &settings);
        let connection = connection.map_err(ClientError::from)?;
        Ok(give(Driver(connection.drive_from(&state))))
    };
    or_fail(connect(), std::ptr::null_mut())
}

/// Leaves the robot's place, which is to be done at rest alone; nothing where the pointer is null.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_driver_free(driver: *mut Driver) {
    free(driver);
}

/// Waits for the next cycle and says what the motors are to do in it: 1; 0 where it was shut down and the motors rest; -1 where it fails.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_driver_next(driver: *mut Driver, targets: *mut MotorTargets) -> i32 {
    let next = || {
        let Driver(driver) = write(driver, "driver")?;
        let targets = write(targets, "targets")?;
        let Some(next) = driver.next_targets() else {
            return Ok(0);
        };
        *targets = next.into();
        Ok(1)
    };
    or_fail(next(), -1)
}

/// Publishes what the motors did in this cycle: 9 measured lengths of the tendons relative to the straight robot, metres, and a
/// `PccMotorFault`; one that cannot be sent is left out. 0, or -1 where an argument is not allowed.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_driver_report(
    driver: *mut Driver,
    measured_m: *const f64,
    fault: u32,
) -> i32 {
    let report = || {
        let Driver(driver) = write(driver, "driver")?;
        driver.report(&tendons(measured_m, "measured_m")?, motor_fault(fault)?);
        Ok(0)
    };
    or_fail(report(), -1)
}

/// Has Ctrl-C and SIGTERM do what `pcc_driver_shut_down` does, in place of ending the process in motion. 0, or -1 where it fails.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_driver_shut_down_at_signals(driver: *mut Driver) -> i32 {
    let register = || {
        let Driver(driver) = write(driver, "driver")?;
        driver.shut_down_at_signals().map_err(ClientError::from)?;
        Ok(0)
    };
    or_fail(register(), -1)
}

/// Ramps the motors to rest; go on with cycles until `pcc_driver_next` says 0. 0, or -1 where it fails.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_driver_shut_down(driver: *const Driver) -> i32 {
    let shut_down = || {
        read(driver, "driver")?.0.shut_down();
        Ok(0)
    };
    or_fail(shut_down(), -1)
}

/// Motors that stand at these lengths, or at 0 where the pointer is null.
pub(crate) fn motors(position_m: *const f64) -> Outcome<TendonState> {
    let position_m = match position_m.is_null() {
        true => [0.0; TENDONS],
        false => tendons(position_m, "position_m")?,
    };
    Ok(TendonState {
        position_m,
        ..TendonState::default()
    })
}

pub(crate) fn motor_fault(code: u32) -> Outcome<MotorFault> {
    let refused = |unknown: UnknownCode| Failure::argument(unknown.to_string());
    MotorFault::try_from(code).map_err(refused)
}

pub(crate) fn tendons(pointer: *const f64, name: &str) -> Outcome<[f64; TENDONS]> {
    let lengths = array(pointer, TENDONS, name)?;
    let refused = |_| Failure::argument(format!("{name} has not {TENDONS} lengths"));
    lengths.try_into().map_err(refused)
}
