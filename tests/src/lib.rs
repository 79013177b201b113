//! Whole-process tests: a daemon, a controller and a simulated robot in a private world, and what is asked of them.
//!
//! The integration tests and `scripts/acceptance` share these scenarios; they differ in counts and in what they do with
//! the figures. A broken environment (no temporary folder, a program that does not build) panics: nothing can be tested.
#![allow(clippy::unwrap_used, reason = "a test harness fails by panicking")]

pub mod borders;
pub mod concurrency;
pub mod diffusion_starts;
pub mod geometry;
pub mod kills;
pub mod listener;
pub mod motion;
pub mod priority;
pub mod process;
pub mod programs;
pub mod raw;
pub mod recording;
pub mod stack;
pub mod starts;
pub mod system_calls;
pub mod trial;
pub mod world;
