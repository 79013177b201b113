//! Orders to the controller.

use super::check::{check_code, check_flag, check_range, check_version};
use super::invalid::{Invalid, invalid};
use crate::PROTOCOL_VERSION;
use crate::codes::{CommandKind, CommandRefusal, LoopState};
use crate::message;

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
    /// The wire form.
    #[must_use]
    pub fn to_wire(self, command_id: u64) -> message::Command {
        let (kind, speed) = match self {
            Self::Stop => (CommandKind::Stop, 0.0),
            Self::ResetFault => (CommandKind::ResetFault, 0.0),
            Self::SetSpeed(speed) => (CommandKind::SetSpeed, speed),
            Self::Pause => (CommandKind::Pause, 0.0),
            Self::Resume => (CommandKind::Resume, 0.0),
        };
        message::Command {
            protocol_version: PROTOCOL_VERSION,
            kind: kind.code(),
            speed,
            command_id,
        }
    }
}

impl TryFrom<&message::Command> for Command {
    type Error = Invalid;

    fn try_from(wire: &message::Command) -> Result<Self, Invalid> {
        check_version(wire.protocol_version)?;
        match check_code("kind", wire.kind)? {
            CommandKind::Stop => Ok(Self::Stop),
            CommandKind::ResetFault => Ok(Self::ResetFault),
            CommandKind::Pause => Ok(Self::Pause),
            CommandKind::Resume => Ok(Self::Resume),
            CommandKind::SetSpeed => check_range(wire.speed, 0.0, 1.0, "0..=1")
                .map(Self::SetSpeed)
                .map_err(|reason| invalid("speed", reason)),
        }
    }
}

/// The reply to an order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CommandReply {
    /// The sender's number of the command that this answers.
    pub command_id: u64,
    /// Whether the order takes effect.
    pub accepted: bool,
    /// Why the order has no effect; `None` if it was accepted.
    pub reason: CommandRefusal,
    /// The controller's state when it answered.
    pub state: LoopState,
}

impl TryFrom<&message::CommandReply> for CommandReply {
    type Error = Invalid;

    fn try_from(wire: &message::CommandReply) -> Result<Self, Invalid> {
        check_version(wire.protocol_version)?;
        Ok(Self {
            command_id: wire.command_id,
            accepted: check_flag("accepted", wire.accepted)?,
            reason: check_code("reason", wire.reason)?,
            state: check_code("state", wire.state)?,
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
            assert_eq!(Command::try_from(&command.to_wire(3)), Ok(command));
        }
    }

    #[test]
    fn bad_commands_are_refused_with_the_field_named() {
        let speed = Command::SetSpeed(0.5).to_wire(1);
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
        ];
        for (wire, text) in cases {
            let error = Command::try_from(&wire).expect_err(text);
            assert!(error.to_string().starts_with(text), "{error}");
        }
        let stop = message::Command {
            speed: f64::NAN,
            ..Command::Stop.to_wire(1)
        };
        assert_eq!(
            Command::try_from(&stop),
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
            message::CommandReply { reason: 99, ..good },
            message::CommandReply { state: 99, ..good },
        ] {
            CommandReply::try_from(&bad).unwrap_err();
        }
    }
}
