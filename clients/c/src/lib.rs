//! The client for C, and for every language that calls C: the functions of `include/pcc/client.h`, over the crate `client`.
//!
//! * What is connected is an opaque value that is freed by its own function, in the thread that made it.
//! * Messages are the structs of `include/pcc/messages.h`, which is written from `shared-types`.
//! * A function that fails returns a null pointer or a negative number; [`pcc_last_error`] says why, in words, and
//!   [`pcc_last_error_kind`] by a code.
//! * Times that a call may take are seconds.
#![allow(unsafe_code)] // Pointers come from C.

mod controller;
mod driver;
mod error;
mod follower;
mod goal;
mod plan;
mod pointer;
mod results;
mod scene;
mod text;

pub use self::controller::{
    ControllerView, RobotView, pcc_controller_command, pcc_controller_connect, pcc_controller_free,
    pcc_controller_state, pcc_robot_connect, pcc_robot_free, pcc_robot_state,
};
pub use driver::{
    Driver, MotorTargets, pcc_driver_connect, pcc_driver_free, pcc_driver_next, pcc_driver_report,
    pcc_driver_shut_down, pcc_driver_shut_down_at_signals,
};
pub use error::{ErrorKind, pcc_last_error, pcc_last_error_kind};
pub use follower::{
    FollowedCycle, Follower, pcc_follower_connect, pcc_follower_free, pcc_follower_next,
    pcc_follower_report, pcc_follower_shut_down, pcc_follower_shut_down_at_signals,
};
pub use goal::{
    GoalSender, pcc_goal_connect, pcc_goal_free, pcc_goal_give, pcc_goal_move,
    pcc_goal_state_robot, pcc_goal_status, pcc_goal_withdraw,
};
pub use plan::{
    Answer, Client, pcc_answer_free, pcc_answer_knots, pcc_answer_report, pcc_client_connect,
    pcc_client_free, pcc_client_state_robot, pcc_execute, pcc_plan, pcc_plan_request,
};
pub use results::{Results, pcc_results_connect, pcc_results_free, pcc_results_wait};
pub use scene::{
    Scene, pcc_scene_confirm, pcc_scene_connect, pcc_scene_free, pcc_scene_leave, pcc_scene_publish,
};
pub use text::pcc_text;
