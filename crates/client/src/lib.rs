//! The small Rust API that programs use to talk to the planner daemon, the controller and the robot.
//!
//! * [`Client`]: asks for plans; answers stay in shared memory ([`PlanAnswer`]);
//! * [`ControllerView`]: the controller's state, and commands to it;
//! * [`GoalSender`]: a goal that may move, which the daemon keeps the robot on its way to; [`GoalView`]: what becomes of it, for who only watches;
//! * [`ResultView`]: how each motion ended, and why;
//! * [`RobotView`], [`CycleRecorder`]: what the robot does, and every cycle of the loop;
//! * [`ScenePublisher`]: publishes the obstacles that a source knows;
//! * [`TimeLimit`]: how long a call may wait, as a [`std::time::Duration`] or with a question whether it is given up.
//!
//! Each connects by itself with [`shared_types::ipc::IpcOptions`], in any start order, and survives the other side's
//! restart. **None of them but [`ScenePublisher`] is `Send`**: create each in the thread that uses it.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod answer;
mod error;
mod goal;
mod plan;
mod result_view;
mod scene;
mod view;
mod waiting;

pub use answer::{Candidate, PlanAnswer};
pub use error::ClientError;
pub use goal::{GoalSender, GoalView};
pub use plan::{Client, Pending};
pub use result_view::ResultView;
pub use scene::ScenePublisher;
pub use view::{ControllerView, CycleRecorder, RobotView};
pub use waiting::TimeLimit;
