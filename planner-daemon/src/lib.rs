//! The planner daemon: keeps robot and model resident, and answers plan requests over shared memory.
//!
//! One thread receives and answers requests and never plans ([`Daemon::run`]); the planner's own workers plan, one request at a time;
//! one publishes motions and watches over the one under way, and does nothing else; two more send heartbeats, while that one goes on,
//! and clean up after dead processes. The plan's way through it: private copy, border check, fair queue, planning, selection, and for
//! a motion to be executed the check against controller and live scene, in the thread that then supervises it.
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
pub use process::termination_flag;
