//! The controller: a hard loop that turns certified trajectories into tendon set-points, and the simulated robot.
//!
//! * [`executive`]: the state machine that decides what the loop does each cycle;
//! * [`arena`]: the hard loop's own memory;
//! * [`service`]: the controller's process: loop, guard and relay threads;
//! * [`robot`]: the simulated robot, and its process;
//! * [`config`]: what both programs have in common.
#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod arena;
pub mod config;
pub mod executive;
#[cfg(test)]
mod fixtures;
mod heartbeat;
pub mod robot;
pub mod service;
mod shared_memory;

/// Tendons in every message; robots with fewer leave the rest at zero.
pub const TENDONS: usize = shared_types::capacity::TENDONS;
const _: () = assert!(
    TENDONS == pcc_model::MAX_TENDONS,
    "robot files allow what a message carries"
);

/// One number a tendon.
pub type TendonVector = [f64; TENDONS];

#[cfg(test)]
#[global_allocator]
static ALLOCATOR: arena::LoopAllocator = arena::LoopAllocator;
