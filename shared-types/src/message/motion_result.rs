//! How a motion ended.

use iceoryx2::prelude::ZeroCopySend;

use super::reason::ReasonText;
use super::wire::wire_message;

wire_message! {
    /// How a trajectory ended that the controller has received (service `motion_result`, one publisher: the controller's relay thread;
    /// history 8). Each has exactly one, in the order in which they ended.
    pub struct MotionResult: "pcc.v7.MotionResult", 248 bytes {
        /// When it ended, nanoseconds of `CLOCK_MONOTONIC`.
        pub stamp_mono_ns: i64,
        /// [`super::ControllerState::instance`] of the controller.
        pub instance: u64,
        /// Counts the results of this controller, from 1: where a number is missing a result was missed.
        pub sequence: u64,
        /// [`super::TrajectoryMessage::plan_id`].
        pub plan_id: u64,
        /// Path time up to which the trajectory was followed, seconds; 0: it was not begun.
        pub path_time_s: f64,
        /// Duration of the motion, seconds; 0 where the trajectory is malformed.
        pub duration_s: f64,
        /// The trajectory.
        pub trajectory_id: u32,
        /// [`crate::codes::MotionOutcome`].
        pub outcome: u32,
        /// The trajectory that left it at its switch; 0: none.
        pub joined_by: u32,
        /// [`crate::codes::StopCause`]: what stopped it or set it aside.
        pub cause: u32,
        /// [`crate::codes::CommandSender`] of the command, where the cause is one.
        pub sender: u32,
        /// The process id of that sender; 0: not told.
        pub sender_pid: u32,
        /// [`crate::codes::LoopFault`], where the cause is one.
        pub fault: u32,
        /// [`crate::codes::Refusal`], where it was refused.
        pub refusal: u32,
        /// Why it ended as it did; empty where it was reached.
        pub reason: ReasonText,
    }
}
