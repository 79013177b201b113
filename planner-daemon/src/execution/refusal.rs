//! Why a motion is not executed.

use shared_types::codes::{LoopFault, LoopState};

use crate::live_scene::{InTheWay, SceneAbsence};

/// Why a motion is planned but not published.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub(crate) enum ExecutionRefusal {
    /// There is no candidate to execute.
    #[error("no candidate is selected")]
    NothingSelected,
    /// No controller is alive to execute the motion.
    #[error("no controller: its state is missing or older than 200 ms")]
    ControllerAbsent,
    /// The controller takes motions of another daemon.
    #[error("the controller has not heard this daemon's heart yet; it takes motions once it has")]
    DaemonUnheard,
    /// The controller takes nothing any more that was asked for so early.
    #[error("a stop, a reset or a start of the controller came after the request, and ends it")]
    EndedByOrder,
    /// The controller is set up for another robot.
    #[error(
        "the controller's robot is {found:016x}, this daemon's {expected:016x}: their robot files differ"
    )]
    OtherRobot { found: u64, expected: u64 },
    /// No controller would receive an order to stop the motion.
    #[error("nobody serves `command`: an order to stop would be lost")]
    CommandUnserved,
    /// The controller is not at rest.
    #[error("the controller is {state} (fault: {fault}); only a holding one takes a motion")]
    NotHolding { state: LoopState, fault: LoopFault },
    /// The motion published before is not over.
    #[error("trajectory {id} is still to be executed")]
    Busy { id: u32 },
    /// The motion that it leaves is not followed any more, or is being stopped.
    #[error("trajectory {id}, which it leaves, is not followed any more")]
    NotFollowed { id: u32 },
    /// The place where it leaves the motion that is followed is too near or passed.
    #[error("switch missed: {}", place_of_leaving(*id, *ahead_s))]
    SwitchMissed { id: u32, ahead_s: f64 },
    /// The controller has refused the motion: it had passed the switch when it took the motion in.
    #[error(
        "the controller has refused trajectory {id}: it had passed the place where that begins"
    )]
    NotBegun { id: u32 },
    /// The plan begins in a state in motion that its request stated.
    #[error(
        "the plan begins in motion in a given state; at rest, or on the robot's motion, is allowed"
    )]
    BeginsInGivenMotion,
    /// The motion would begin with a jump.
    #[error(
        "the start is {distance_rad:.3e} rad away from the commanded configuration; at most 1e-6 rad is allowed"
    )]
    StartsElsewhere { distance_rad: f64 },
    /// The live scene is missing.
    #[error(transparent)]
    NoScene(#[from] SceneAbsence),
    /// The motion is not certified free of the live scene.
    #[error(transparent)]
    SceneInTheWay(#[from] InTheWay),
    /// The motion under way to the same goal is nearly as fast.
    #[error("what remains of the motion under way, {remaining_s:.3} s, is not longer by a tenth")]
    NoBetter { remaining_s: f64 },
    /// The goal was given up or replaced while the motion was planned.
    #[error("the goal was given up meanwhile")]
    GoalGivenUp,
    /// The daemon ends and would not supervise the motion.
    #[error("the daemon ends")]
    DaemonEnds,
    /// The supervision thread did not reply in time.
    #[error(
        "the supervision of motions does not answer: it is held; a motion that it has published all the same is taken back, or \
         stopped along its path"
    )]
    SupervisionStalled,
    /// iceoryx2 could not send the trajectory.
    #[error("the trajectory could not be published")]
    NotPublished,
}

/// Where a motion leaves another one, whose path time is `ahead_s` before it, or past it where that is negative.
fn place_of_leaving(id: u32, ahead_s: f64) -> String {
    if ahead_s < 0.0 {
        let past_s = -ahead_s;
        return format!("trajectory {id} was to be left {past_s:.3} s before where it is now");
    }
    format!("trajectory {id} is to be left in {ahead_s:.4} s: too soon for it to arrive in time")
}
