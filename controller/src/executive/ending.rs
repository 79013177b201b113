//! How a motion ends: reached, joined by another one, stopped, or set aside; and what caused a stop.

use std::fmt::{self, Display, Formatter};

use shared_types::codes::{LoopFault, MotionOutcome, StopCause};
use shared_types::valid::Signature;

use super::motion::Motion;

/// What stops a motion or sets it aside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StopOrigin {
    /// A command to stop.
    Command(Signature),
    /// A command to reset.
    Reset(Signature),
    /// The daemon's heartbeats stay away.
    DaemonLost,
    /// Another daemon has taken the place of the one before.
    OtherDaemon,
    /// A signal to the process.
    Signal,
    /// The process ends.
    Shutdown,
    /// The machine was suspended.
    Suspension,
    /// A fault of the loop.
    Fault(LoopFault),
    /// The robot is let go of while it is at rest: it takes no set-points.
    RobotGone,
}

impl StopOrigin {
    /// The cause's number in the result of a motion.
    #[must_use]
    pub fn code(&self) -> StopCause {
        match self {
            Self::Command(_) => StopCause::Command,
            Self::Reset(_) => StopCause::Reset,
            Self::DaemonLost => StopCause::DaemonLost,
            Self::OtherDaemon => StopCause::OtherDaemon,
            Self::Signal => StopCause::Signal,
            Self::Shutdown => StopCause::Shutdown,
            Self::Suspension => StopCause::Suspension,
            Self::Fault(_) => StopCause::Fault,
            Self::RobotGone => StopCause::RobotGone,
        }
    }

    /// Who gave the command, and why, where it is one.
    #[must_use]
    pub fn signature(&self) -> Option<&Signature> {
        match self {
            Self::Command(signature) | Self::Reset(signature) => Some(signature),
            _ => None,
        }
    }
}

/// The reason that a command's sender gives; without one, who gave it; else what happened.
impl Display for StopOrigin {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Command(signature) | Self::Reset(signature) => {
                match signature.reason.text().as_ref() {
                    "" => write!(formatter, "{} of {}", self.code(), signature.sender),
                    reason => formatter.write_str(reason),
                }
            }
            Self::Fault(fault) => fault.fmt(formatter),
            _ => self.code().fmt(formatter),
        }
    }
}

/// How a motion that was taken ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Ending {
    /// It was followed to its end.
    Reached,
    /// The motion with this id left it.
    Joined(u32),
    /// It was stopped after its begin.
    Stopped(StopOrigin),
    /// It was given up before its begin or its switch.
    SetAside(StopOrigin),
}

impl Ending {
    /// The outcome's number in the result of the motion.
    #[must_use]
    pub fn code(&self) -> MotionOutcome {
        match self {
            Self::Reached => MotionOutcome::Reached,
            Self::Joined(_) => MotionOutcome::Joined,
            Self::Stopped(_) => MotionOutcome::Stopped,
            Self::SetAside(_) => MotionOutcome::SetAside,
        }
    }

    /// What stopped the motion or set it aside.
    #[must_use]
    pub fn origin(&self) -> Option<&StopOrigin> {
        match self {
            Self::Stopped(origin) | Self::SetAside(origin) => Some(origin),
            Self::Reached | Self::Joined(_) => None,
        }
    }
}

/// A motion that is over, on its way out of the loop.
#[derive(Clone, Debug)]
pub struct EndedMotion {
    /// The motion.
    pub motion: Motion,
    /// How it ended.
    pub ending: Ending,
    /// Path time up to which it was followed, s.
    pub path_time_s: f64,
    /// When it ended, ns of CLOCK_MONOTONIC.
    pub stamp_ns: i64,
}
