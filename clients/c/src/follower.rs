//! Following trajectories in the controller's place.

use std::ffi::c_char;
use std::mem::offset_of;
use std::path::Path;

use ::controller::service::{self, ControllerConfig};
use client::ClientError;

use crate::driver::{MotorTargets, motor_fault, motors, tendons};
use crate::error::{Failure, or_fail};
use crate::pointer::{free, give, options, read, text, write};

/// The follower of trajectories; it has the controller's place.
pub struct Follower(service::Follower);

/// One cycle of a follower: what the motors are to do, and the configuration that is commanded.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct FollowedCycle {
    /// What the motors are to do.
    pub targets: MotorTargets,
    /// The configuration of the set-point, radians.
    pub configuration_rad: [f64; 6],
    /// Radians a second.
    pub velocity_rad_s: [f64; 6],
    /// Radians a second squared.
    pub acceleration_rad_s2: [f64; 6],
    /// A `PccLoopState`.
    pub state: u32,
    /// The trajectory being followed, 0 for none.
    pub trajectory_id: u32,
}

// The header has the same, written from cbindgen.toml.
const _: () = {
    assert!(size_of::<FollowedCycle>() == 376);
    assert!(offset_of!(FollowedCycle, targets) == 0);
    assert!(offset_of!(FollowedCycle, configuration_rad) == 224);
    assert!(offset_of!(FollowedCycle, velocity_rad_s) == 272);
    assert!(offset_of!(FollowedCycle, acceleration_rad_s2) == 320);
    assert!(offset_of!(FollowedCycle, state) == 368);
    assert!(offset_of!(FollowedCycle, trajectory_id) == 372);
};

/// Takes the controller's place by a configuration file like `config/controller.toml`, with motors that stand at `position_m` (9 lengths of
/// the tendons relative to the straight robot, metres; null: all 0). Null where it fails, also where another controller is there.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_follower_connect(
    prefix: *const c_char,
    root: *const c_char,
    config_file: *const c_char,
    position_m: *const f64,
) -> *mut Follower {
    let connect = || {
        let file = Path::new(text(config_file, "config_file")?);
        let config = ControllerConfig::from_file(file);
        let config = config.map_err(|it| Failure::argument(it.to_string()))?;
        let state = motors(position_m)?;
        let follower = service::Follower::open(config, &options(prefix, root)?, &state);
        Ok(give(Follower(follower.map_err(ClientError::from)?)))
    };
    or_fail(connect(), std::ptr::null_mut())
}

/// Leaves the controller's place, which is to be done at rest alone; nothing where the pointer is null.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_follower_free(follower: *mut Follower) {
    free(follower);
}

/// Waits for the next cycle and says what the motors are to do in it: 1; 0 where it was shut down and the robot is at rest; -1 where it fails.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_follower_next(follower: *mut Follower, cycle: *mut FollowedCycle) -> i32 {
    let next = || {
        let Follower(follower) = write(follower, "follower")?;
        let told = write(cycle, "cycle")?;
        let Some(next) = follower.next_cycle() else {
            return Ok(0);
        };
        *told = FollowedCycle {
            targets: next.targets.into(),
            configuration_rad: next.commanded.position.into(),
            velocity_rad_s: next.commanded.velocity.into(),
            acceleration_rad_s2: next.commanded.acceleration.into(),
            state: next.state.code(),
            trajectory_id: next.trajectory_id,
        };
        Ok(1)
    };
    or_fail(next(), -1)
}

/// Says what the motors did in this cycle: 9 measured lengths of the tendons relative to the straight robot, metres, and a `PccMotorFault`.
/// 0, or -1 where it fails.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_follower_report(
    follower: *mut Follower,
    measured_m: *const f64,
    fault: u32,
) -> i32 {
    let report = || {
        let Follower(follower) = write(follower, "follower")?;
        follower.report(&tendons(measured_m, "measured_m")?, motor_fault(fault)?);
        Ok(0)
    };
    or_fail(report(), -1)
}

/// Has Ctrl-C and SIGTERM do what `pcc_follower_shut_down` does, in place of ending the process in motion. 0, or -1 where it fails.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_follower_shut_down_at_signals(follower: *mut Follower) -> i32 {
    let register = || {
        let Follower(follower) = write(follower, "follower")?;
        follower.shut_down_at_signals().map_err(ClientError::from)?;
        Ok(0)
    };
    or_fail(register(), -1)
}

/// Stops the robot along its path; go on with cycles until `pcc_follower_next` says 0. 0, or -1 where it fails.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_follower_shut_down(follower: *const Follower) -> i32 {
    let shut_down = || {
        read(follower, "follower")?.0.shut_down();
        Ok(0)
    };
    or_fail(shut_down(), -1)
}
