//! The wire messages: `repr(C)`, plain numbers and arrays, no padding, one versioned type name each.
//!
//! Each type has `ZEROED`, all fields zero, to start from. None of them is checked: see [`crate::valid`].

mod command;
mod controller_state;
mod heartbeat;
mod motion_result;
mod plan;
mod reason;
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
pub use reason::ReasonText;
pub use robot_state::RobotState;
pub use scene::{MovingBall, SceneMessage, SceneStatus};
pub use setpoint::Setpoint;
pub use standing_goal::{GoalStatus, StandingGoal};
pub use trajectory::{Knot, TrajectoryMessage};
pub use wire::Zeroed;

#[cfg(test)]
mod tests {
    use super::wire::Field;
    use super::*;
    use crate::PROTOCOL_VERSION;
    use iceoryx2::prelude::ZeroCopySend;
    use std::fmt::Write;

    /// The name by which iceoryx2 tells a type from others.
    #[allow(
        unsafe_code,
        reason = "iceoryx2 makes reading a type name unsafe for those who rely on its layout"
    )]
    fn type_name<T: ZeroCopySend>() -> &'static str {
        // SAFETY: only the text is read; nothing is assumed of the layout.
        unsafe { <T as ZeroCopySend>::type_name() }
    }

    /// The layout of all messages as text, one line a field: offset, bytes, name, type. Every type's name must carry the protocol's
    /// version: services of another version cannot be joined then.
    fn layout() -> String {
        let mut text = String::new();
        macro_rules! describe {
            ($($message:ident),*) => { $(
                let name = format!("pcc.v{PROTOCOL_VERSION}.{}", stringify!($message));
                assert_eq!(type_name::<$message>(), name);
                writeln!(text, "{name} {} bytes", size_of::<$message>()).unwrap();
                for Field { name, rust_type, offset, bytes } in $message::FIELDS {
                    writeln!(text, "{offset:>6} {bytes:>6} {name}: {rust_type}").unwrap();
                }
            )* };
        }
        describe!(
            ReasonText,
            Knot,
            Ball,
            Goal,
            PlanRequest,
            CandidateSummary,
            PlanReport,
            TrajectoryMessage,
            Setpoint,
            RobotState
        );
        describe!(
            ControllerState,
            Cycle,
            MotionResult,
            MovingBall,
            SceneMessage,
            SceneStatus,
            StandingGoal,
            GoalStatus,
            Heartbeat,
            Command,
            CommandReply
        );
        text
    }

    #[test]
    fn the_layout_is_the_published_one_and_type_names_carry_the_version() {
        let layout = layout();
        assert!(
            layout == include_str!("../../layout.txt"),
            "layout.txt is not what the messages are now:\n{layout}"
        );
    }
}
