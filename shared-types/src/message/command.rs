//! Orders to the controller, and their replies.

use iceoryx2::prelude::ZeroCopySend;

use super::reason::ReasonText;
use super::wire::wire_message;

wire_message! {
    /// An order (service `command`, server: the controller's guard thread).
    pub struct Command: "pcc.v7.Command", 200 bytes {
        /// [`crate::PROTOCOL_VERSION`] of the sender.
        pub protocol_version: u32,
        /// [`crate::codes::CommandKind`].
        pub kind: u32,
        /// The rate to run at, 0..=1, if the kind is set speed.
        pub speed: f64,
        /// The sender's number for this command; returned in the reply.
        pub command_id: u64,
        /// [`crate::codes::CommandSender`].
        pub sender: u32,
        /// The sender's process id; 0: not told.
        pub sender_pid: u32,
        /// Why it is ordered, as the results of the motions tell it that it stops.
        pub reason: ReasonText,
    }
}

wire_message! {
    /// The reply to an order.
    pub struct CommandReply: "pcc.v7.CommandReply", 192 bytes {
        /// The sender's number of the command that this answers.
        pub command_id: u64,
        /// [`crate::PROTOCOL_VERSION`] of the controller.
        pub protocol_version: u32,
        /// 1: the command takes effect; 0: it does not.
        pub accepted: u32,
        /// [`crate::codes::CommandRefusal`]: why the command has no effect; none: it has.
        pub refusal: u32,
        /// [`crate::codes::LoopState`] when the command was answered.
        pub state: u32,
        /// What is wrong, or what the robot does, in words.
        pub reason: ReasonText,
    }
}
