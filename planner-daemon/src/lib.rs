//! The planner daemon: keeps robot and model resident, and answers plan requests over shared memory.
//!
//! Its threads:
//!
//! - The service thread receives and answers requests, and never plans ([`Daemon::run`]).
//! - The planner's workers plan, one request at a time.
//! - The supervision thread publishes motions and supervises the one under way, and does nothing else.
//! - The heartbeat thread sends heartbeats while supervision goes on.
//! - The cleaning thread cleans up after dead processes.
//!
//! A request is copied to private memory, validated, queued fairly and planned, and a candidate is selected. A motion that is to be
//! executed is checked against the controller and the live scene, in the thread that then supervises it.
//!
//! On the wire everything is SI; inside, lengths are in units of the robot's section length.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod execution;
mod goal_keeping;
mod identity;
mod knots;
mod live_scene;
mod requests;
mod startup;
mod tip_tolerance;

#[cfg(test)]
mod fixtures;

pub use execution::BackgroundError;
pub use live_scene::SceneMemoryError;
pub use requests::{PlannerKind, WaitMode};
pub use startup::{Config, ConfigError, Daemon, StartError, termination_flag};
