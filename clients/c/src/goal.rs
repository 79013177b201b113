//! A goal that the daemon keeps the robot on its way to.

use std::ffi::c_char;

use shared_types::message::{self, GoalStatus};
use shared_types::valid;

use crate::controller::tell;
use crate::error::{Failure, Outcome, or_fail};
use crate::pointer::{free, give, options, read, robot, write};

/// Gives the daemon a goal, moves it, and hears what becomes of it.
pub struct GoalSender(client::GoalSender);

/// Joins the services of goals; the daemon need not run yet. Null where it fails.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_goal_connect(prefix: *const c_char, root: *const c_char) -> *mut GoalSender {
    let connect = || client::GoalSender::connect(&options(prefix, root)?).map_err(Failure::from);
    or_fail(
        connect().map(|goal| give(GoalSender(goal))),
        std::ptr::null_mut(),
    )
}

/// Ends it; the goal stays. Nothing where the pointer is null.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_goal_free(sender: *mut GoalSender) {
    free(sender);
}

/// States the robot file that this program is set up for: a daemon that plans for another robot refuses every goal that is given from now
/// on. 0, or -1 where the file is none.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_goal_state_robot(sender: *mut GoalSender, robot_file: *const c_char) -> i32 {
    let state = || {
        let GoalSender(sender) = write(sender, "sender")?;
        sender.state_robot(robot(robot_file)?.hash());
        Ok(0)
    };
    or_fail(state(), -1)
}

/// Gives another goal, to be reached with a share of the tendon limits (1e-9 to 1); it takes the place of every earlier one. 0, or -1 where
/// it fails.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_goal_give(
    sender: *mut GoalSender,
    goal: *const message::Goal,
    limits_scale: f64,
) -> i32 {
    let give = || {
        let GoalSender(sender) = write(sender, "sender")?;
        sender.give(checked(goal)?, limits_scale)?;
        Ok(0)
    };
    or_fail(give(), -1)
}

/// Says where the goal that was given last is now, and with which velocity it moves where it is a tip (three numbers, base frame, m/s). 0,
/// or -1 where it fails.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_goal_move(
    sender: *mut GoalSender,
    goal: *const message::Goal,
    tip_velocity_m_s: *const [f64; 3],
) -> i32 {
    let move_on = || {
        let GoalSender(sender) = write(sender, "sender")?;
        let velocity_m_s = read(tip_velocity_m_s, "tip_velocity_m_s")?;
        sender.move_to(checked(goal)?, *velocity_m_s)?;
        Ok(0)
    };
    or_fail(move_on(), -1)
}

/// Gives the goal up: the robot brakes along its path. 0, or -1 where it fails.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_goal_withdraw(sender: *mut GoalSender) -> i32 {
    let withdraw = || {
        let GoalSender(sender) = write(sender, "sender")?;
        sender.withdraw()?;
        Ok(0)
    };
    or_fail(withdraw(), -1)
}

/// The newest status of the goal that was given last: 1 and the status, 0 until the daemon has heard it and once
/// that daemon has ended before the goal, -1 where it fails.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_goal_status(sender: *mut GoalSender, status: *mut GoalStatus) -> i32 {
    let newest = || {
        let GoalSender(sender) = write(sender, "sender")?;
        let newest = sender.status()?.map(|newest| newest.values);
        tell(newest, status)
    };
    or_fail(newest(), -1)
}

fn checked(goal: *const message::Goal) -> Outcome<valid::Goal> {
    Ok(valid::Goal::try_from(read(goal, "goal")?)?)
}
