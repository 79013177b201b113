//! The planner daemon: keeps robot and model resident, and answers plan requests over shared memory.
//!
//! Its threads:
//!
//! - The service thread receives and answers requests, and never plans ([`Daemon::run`]).
//! - The planner's workers plan, one request at a time.
//! - The supervision thread publishes motions and watches over the one under way, and does nothing else.
//! - The heartbeat thread sends heartbeats while supervision goes on.
//! - The cleaning thread cleans up after dead processes.
//!
//! A request is copied to private memory, checked at the border, queued fairly and planned, and a candidate is selected. A motion that is to be
//! executed is checked against the controller and the live scene, in the thread that then supervises it.
//!
//! On the wire everything is SI; inside, lengths are in units of the robot's section length.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod admission;
mod answer;
mod awake;
mod config;
mod daemon;
mod execution;
mod heartbeat;
mod kept_plans;
mod live_scene;
mod moving_cover;
mod planning_at_work;
mod process;
mod queue;
mod refusal;
mod scene_inbox;
mod service;
mod stop_order;
mod supervision;
mod supervisor;
mod wire;

#[cfg(test)]
mod fixtures;

pub use config::{Config, ConfigError, WaitMode};
pub use daemon::{Daemon, StartError};
pub use heartbeat::BackgroundError;
pub use live_scene::SceneMemoryError;
pub use process::termination_flag;
