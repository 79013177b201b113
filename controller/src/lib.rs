//! The controller: a hard loop that turns certified trajectories into tendon set-points, and the simulated robot.
//!
//! * [`executive`]: the state machine that decides what the loop does each cycle;
//! * [`arena`]: the hard loop's own memory;
//! * [`service`]: the controller's process: loop, guard, relay and cleaning threads;
//! * [`robot`]: the simulated robot, and its process.
#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod arena;
pub mod executive;
#[cfg(test)]
mod fixtures;
pub mod robot;
pub mod service;

pub use robot_driver::{TENDONS, TendonVector};

#[cfg(test)]
#[global_allocator]
static ALLOCATOR: arena::LoopAllocator = arena::LoopAllocator;
