//! The validated twin of each message but set-points, which the robot checks against its own limits: made by `TryFrom`, which rejects
//! what is wrong, says what would be allowed, and never clamps.
//!
//! Checked here is what needs no robot: versions, counts, codes, finiteness, magnitudes that arithmetic survives, order
//! of times. Whether a robot can bend that far is the daemon's business. Fields that a message does not use (the goal
//! configuration of a tip goal, array elements beyond the count) are not read.
//! Copy a message out of shared memory first: another process could change it after the check.

mod check;
mod command;
mod goal;
mod invalid;
mod motion_result;
mod plan;
mod planned_execution;
mod report;
mod scene;
mod standing_goal;
mod state;
mod trajectory;

pub use check::{
    LEAST_LIMITS_SCALE, LEAST_PATH_TOLERANCE_RAD, MAX_ANGLE_RAD, MAX_DURATION_S, MAX_LENGTH_M,
    MAX_RATE,
};
pub use command::{Command, CommandReply, Signature, SignedCommand};
pub use goal::Goal;
pub use invalid::{Invalid, Reason};
pub use motion_result::MotionResult;
pub use plan::{PlanRequest, PreviousPlan, SelectionRule};
pub use planned_execution::{Asked, PlannedExecution};
pub use report::PlanReport;
pub use scene::{Heartbeat, MOST_SCENE_LIFETIME_NS, Scene, SceneStatus, SourceName, stamp_refusal};
pub use standing_goal::{GoalStatus, StandingGoal};
pub use state::{ControllerState, Cycle, RobotState};
pub use trajectory::{Trajectory, check_knots};

/// A change to a good message, and how the error that it must cause begins.
#[cfg(test)]
type BadCase<W> = (fn(&mut W), &'static str);
