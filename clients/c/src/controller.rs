//! What controller and robot do, and orders to the controller.

use std::ffi::c_char;

use shared_types::PROTOCOL_VERSION;
use shared_types::codes::{CommandKind, CommandSender};
use shared_types::message::{self, CommandReply, ControllerState, ReasonText, RobotState};
use shared_types::valid::SignedCommand;

use crate::error::{Failure, Outcome, or_fail};
use crate::pointer::{free, give, optional_text, options, time_limit, write};

/// The controller's state, and orders to it.
pub struct ControllerView(client::ControllerView);

/// The robot's state.
pub struct RobotView(client::RobotView);

/// Joins the controller's services; it need not run yet. Null where it fails.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_controller_connect(
    prefix: *const c_char,
    root: *const c_char,
) -> *mut ControllerView {
    let connect =
        || client::ControllerView::connect(&options(prefix, root)?).map_err(Failure::from);
    let view = connect().map(|view| give(ControllerView(view)));
    or_fail(view, std::ptr::null_mut())
}

/// Ends it; nothing where the pointer is null.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_controller_free(controller: *mut ControllerView) {
    free(controller);
}

/// The newest state, however old: 1 and the state, 0 where the controller has published none, -1 where it fails.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_controller_state(
    controller: *mut ControllerView,
    state: *mut ControllerState,
) -> i32 {
    let newest = || {
        let ControllerView(view) = write(controller, "controller")?;
        let newest = view.latest_state()?.map(|newest| newest.values);
        tell(newest, state)
    };
    or_fail(newest(), -1)
}

/// Gives an order (a `PccCommandKind`) with the speed to run at, which only setting the speed needs, and a reason that is told to others (may
/// be null), and waits for the reply, `timeout_s` seconds in all: 1 where it takes effect, 0 where the controller refuses it, -1 where it
/// fails. The reply is written to `reply`, unless that is null.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_controller_command(
    controller: *mut ControllerView,
    kind: u32,
    speed: f64,
    reason: *const c_char,
    timeout_s: f64,
    reply: *mut CommandReply,
) -> i32 {
    let order = || {
        let ControllerView(view) = write(controller, "controller")?;
        let wire = message::Command {
            protocol_version: PROTOCOL_VERSION,
            kind,
            speed: if kind == CommandKind::SetSpeed.code() {
                speed
            } else {
                0.0
            },
            sender: CommandSender::Program.code(),
            sender_pid: std::process::id(),
            reason: ReasonText::new(optional_text(reason, "reason")?.unwrap_or_default()),
            ..message::Command::ZEROED
        };
        let answered = view.command(SignedCommand::try_from(&wire)?, time_limit(timeout_s)?)?;
        if let Ok(reply) = write(reply, "reply") {
            *reply = CommandReply {
                command_id: answered.command_id,
                protocol_version: PROTOCOL_VERSION,
                accepted: u32::from(answered.accepted),
                refusal: answered.refusal.code(),
                state: answered.state.code(),
                reason: answered.reason,
            };
        }
        Ok(i32::from(answered.accepted))
    };
    or_fail(order(), -1)
}

/// Joins the robot's service; it need not run yet. Null where it fails.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_robot_connect(prefix: *const c_char, root: *const c_char) -> *mut RobotView {
    let connect = || client::RobotView::connect(&options(prefix, root)?).map_err(Failure::from);
    or_fail(
        connect().map(|view| give(RobotView(view))),
        std::ptr::null_mut(),
    )
}

/// Ends it; nothing where the pointer is null.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_robot_free(robot: *mut RobotView) {
    free(robot);
}

/// The newest state, however old: 1 and the state, 0 where the robot has published none, -1 where it fails.
#[unsafe(no_mangle)]
pub extern "C" fn pcc_robot_state(robot: *mut RobotView, state: *mut RobotState) -> i32 {
    let newest = || {
        let RobotView(view) = write(robot, "robot")?;
        let newest = view.latest()?.map(|newest| newest.values);
        tell(newest, state)
    };
    or_fail(newest(), -1)
}

/// Writes what there is: 1, or 0 where there is nothing.
pub(crate) fn tell<T>(newest: Option<T>, to: *mut T) -> Outcome<i32> {
    let to = write(to, "the place of the answer")?;
    let is_there = i32::from(newest.is_some());
    if let Some(newest) = newest {
        *to = newest;
    }
    Ok(is_there)
}
