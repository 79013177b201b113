//! Why this daemon has a motion stopped.

use crate::live_scene::{InTheWay, SceneAbsence};

/// Why a motion is stopped.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub(crate) enum StopReason {
    /// The motion is not certified free of the live scene.
    #[error(transparent)]
    SceneInTheWay(#[from] InTheWay),
    /// The live scene is missing.
    #[error(transparent)]
    NoScene(#[from] SceneAbsence),
    /// The controller has sent no fresh state for 200 ms.
    #[error("the controller has not said for 200 ms what it does")]
    ControllerSilent,
    /// The controller has not started the motion 300 ms after its begin, and may still do so.
    #[error("the controller has not taken it up 300 ms after its begin")]
    NotStarted,
    /// The motion was published after its request had been refused for a time-out.
    #[error("nobody waits for it any more: supervision was held while it published it")]
    CallerGone,
    /// The goal that the motion leads to was given up.
    #[error("the goal was withdrawn")]
    GoalWithdrawn,
    /// The motion executes and is not this daemon's own.
    #[error("it is executed and nobody watches over it")]
    Unsupervised,
    /// The daemon ends.
    #[error("the daemon ends")]
    DaemonEnds,
}
