//! The planner daemon: keeps robot and model resident, and answers plan requests over shared memory.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod admission;
mod answer;
pub mod config;
mod planning_thread;
mod process;
mod queue;
mod wire;

#[cfg(test)]
mod fixtures;
