//! Orders to the controller.

use super::check::{check_code, check_flag, check_range, check_version};
use super::invalid::{Invalid, invalid};
use crate::PROTOCOL_VERSION;
use crate::codes::{CommandKind, CommandRefusal, CommandSender, LoopState};
use crate::message::{self, ReasonText};

/// An order with its parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Command {
    /// Brake along the path, then hold.
    Stop,
    /// Leave the fault state.
    ResetFault,
    /// Run at this rate, 0..=1.
    SetSpeed(f64),
    /// Brake along the path and stay on it.
    Pause,
    /// Go on after a pause.
    Resume,
}

impl Command {
    /// The command of this process, with the reason that is told to others.
    #[must_use]
    pub fn because(self, reason: &str) -> SignedCommand {
        SignedCommand {
            command: self,
            signature: Signature {
                sender: CommandSender::Program,
                sender_pid: std::process::id(),
                reason: ReasonText::new(reason),
            },
        }
    }

    fn kind(self) -> CommandKind {
        match self {
            Self::Stop => CommandKind::Stop,
            Self::ResetFault => CommandKind::ResetFault,
            Self::SetSpeed(_) => CommandKind::SetSpeed,
            Self::Pause => CommandKind::Pause,
            Self::Resume => CommandKind::Resume,
        }
    }
}

/// Who gives a command, and why.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Signature {
    /// What kind of sender it is.
    pub sender: CommandSender,
    /// The sender's process id; 0: not told.
    pub sender_pid: u32,
    /// Why the command is given; may be empty.
    pub reason: ReasonText,
}

impl Signature {
    /// A program that tells nothing of itself.
    pub const UNSIGNED: Self = Self {
        sender: CommandSender::Program,
        sender_pid: 0,
        reason: ReasonText::ZEROED,
    };
}

/// A command, who gives it, and why.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SignedCommand {
    /// What the controller is to do.
    pub command: Command,
    /// Who gives the command, and why.
    pub signature: Signature,
}

/// A command of this process, without a reason.
impl From<Command> for SignedCommand {
    fn from(command: Command) -> Self {
        command.because("")
    }
}

impl SignedCommand {
    /// The wire form.
    #[must_use]
    pub fn to_wire(&self, command_id: u64) -> message::Command {
        let speed = match self.command {
            Command::SetSpeed(speed) => speed,
            _ => 0.0,
        };
        message::Command {
            protocol_version: PROTOCOL_VERSION,
            kind: self.command.kind().code(),
            speed,
            command_id,
            sender: self.signature.sender.code(),
            sender_pid: self.signature.sender_pid,
            reason: self.signature.reason,
        }
    }
}

impl TryFrom<&message::Command> for SignedCommand {
    type Error = Invalid;

    fn try_from(wire: &message::Command) -> Result<Self, Invalid> {
        check_version(wire.protocol_version)?;
        let command = match check_code("kind", wire.kind)? {
            CommandKind::Stop => Command::Stop,
            CommandKind::ResetFault => Command::ResetFault,
            CommandKind::Pause => Command::Pause,
            CommandKind::Resume => Command::Resume,
            CommandKind::SetSpeed => check_range(wire.speed, 0.0, 1.0, "0..=1")
                .map(Command::SetSpeed)
                .map_err(|reason| invalid("speed", reason))?,
        };
        let signature = Signature {
            sender: check_code("sender", wire.sender)?,
            sender_pid: wire.sender_pid,
            reason: wire.reason,
        };
        Ok(Self { command, signature })
    }
}

/// The reply to an order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CommandReply {
    /// The sender's number of the command that this answers.
    pub command_id: u64,
    /// Whether the order takes effect.
    pub accepted: bool,
    /// Why the order has no effect; `None` if it was accepted.
    pub refusal: CommandRefusal,
    /// The controller's state when it answered.
    pub state: LoopState,
    /// What is wrong, or what the robot does, in words.
    pub reason: ReasonText,
}

impl TryFrom<&message::CommandReply> for CommandReply {
    type Error = Invalid;

    fn try_from(wire: &message::CommandReply) -> Result<Self, Invalid> {
        check_version(wire.protocol_version)?;
        Ok(Self {
            command_id: wire.command_id,
            accepted: check_flag("accepted", wire.accepted)?,
            refusal: check_code("refusal", wire.refusal)?,
            state: check_code("state", wire.state)?,
            reason: wire.reason,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_survive_the_wire() {
        for command in [
            Command::Stop,
            Command::ResetFault,
            Command::SetSpeed(0.0),
            Command::SetSpeed(1.0),
            Command::Pause,
            Command::Resume,
        ] {
            let mut signed = command.because("the ball comes nearer");
            signed.signature.sender = CommandSender::Supervision;
            assert_eq!(SignedCommand::try_from(&signed.to_wire(3)), Ok(signed));
        }
    }

    #[test]
    fn bad_commands_are_refused_with_the_field_named() {
        let speed = SignedCommand::from(Command::SetSpeed(0.5)).to_wire(1);
        let cases = [
            (
                message::Command {
                    protocol_version: 0,
                    ..speed
                },
                "protocol_version is 0",
            ),
            (
                message::Command { kind: 0, ..speed },
                "kind: 0 is no command kind",
            ),
            (
                message::Command { kind: 6, ..speed },
                "kind: 6 is no command kind",
            ),
            (
                message::Command {
                    speed: 1.1,
                    ..speed
                },
                "speed is 1.1; allowed is 0..=1",
            ),
            (
                message::Command {
                    speed: -0.1,
                    ..speed
                },
                "speed is -0.1",
            ),
            (
                message::Command {
                    speed: f64::NAN,
                    ..speed
                },
                "speed is NaN",
            ),
            (
                message::Command { sender: 3, ..speed },
                "sender: 3 is no sender of a command",
            ),
        ];
        for (wire, text) in cases {
            let error = SignedCommand::try_from(&wire).expect_err(text);
            assert!(error.to_string().starts_with(text), "{error}");
        }
        let stop = message::Command {
            speed: f64::NAN,
            ..SignedCommand::from(Command::Stop).to_wire(1)
        };
        assert_eq!(
            SignedCommand::try_from(&stop).map(|signed| signed.command),
            Ok(Command::Stop),
            "a stop has no speed to check"
        );
    }

    #[test]
    fn bad_replies_are_refused() {
        let good = message::CommandReply {
            protocol_version: PROTOCOL_VERSION,
            accepted: 1,
            ..message::CommandReply::ZEROED
        };
        assert!(CommandReply::try_from(&good).unwrap().accepted);
        for bad in [
            message::CommandReply {
                protocol_version: 1,
                ..good
            },
            message::CommandReply {
                accepted: 2,
                ..good
            },
            message::CommandReply {
                refusal: 99,
                ..good
            },
            message::CommandReply { state: 99, ..good },
        ] {
            CommandReply::try_from(&bad).unwrap_err();
        }
    }
}
