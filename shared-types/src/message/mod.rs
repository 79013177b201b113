//! The wire messages: `repr(C)`, plain numbers and arrays, no padding, one versioned type name each.
//!
//! Each type has `ZEROED`, all fields zero, to start from. None of them is checked: see [`crate::valid`].

mod command;
mod controller_state;
mod heartbeat;
mod motion_result;
mod plan;
mod plan_record;
mod reason;
mod robot_description;
mod robot_state;
mod scene;
mod setpoint;
mod standing_goal;
mod trajectory;
mod wire;

pub use command::{Command, CommandReply};
pub use controller_state::{ControllerState, Cycle};
pub use heartbeat::Heartbeat;
pub use motion_result::MotionResult;
pub use plan::{Ball, CandidateSummary, Goal, NONE_SELECTED, PlanReport, PlanRequest};
pub use plan_record::PlanRecord;
pub use reason::ReasonText;
pub use robot_description::RobotDescription;
pub use robot_state::RobotState;
pub use scene::{MovingBall, SceneMessage, SceneStatus};
pub use setpoint::Setpoint;
pub use standing_goal::{GoalStatus, StandingGoal};
pub use trajectory::{Knot, TrajectoryMessage};
pub use wire::{Field, FieldType, Layout, Payload};

/// Every message and what messages are made of, as data.
pub const LAYOUTS: &[Layout] = &[
    ReasonText::LAYOUT,
    Knot::LAYOUT,
    Ball::LAYOUT,
    Goal::LAYOUT,
    PlanRequest::LAYOUT,
    CandidateSummary::LAYOUT,
    PlanReport::LAYOUT,
    PlanRecord::LAYOUT,
    TrajectoryMessage::LAYOUT,
    Setpoint::LAYOUT,
    RobotDescription::LAYOUT,
    RobotState::LAYOUT,
    ControllerState::LAYOUT,
    Cycle::LAYOUT,
    MotionResult::LAYOUT,
    MovingBall::LAYOUT,
    SceneMessage::LAYOUT,
    SceneStatus::LAYOUT,
    StandingGoal::LAYOUT,
    GoalStatus::LAYOUT,
    Heartbeat::LAYOUT,
    Command::LAYOUT,
    CommandReply::LAYOUT,
];
