//! Whole-process tests: a daemon, a controller and a simulated robot in a private world, and what is asked of them.
//!
//! The integration tests and `scripts/acceptance` share these scenarios; they differ in counts and in what they do with
//! the figures. A broken environment (no temporary folder, a program that does not build) panics: nothing can be tested.
#![allow(clippy::unwrap_used, reason = "a test harness fails by panicking")]

pub mod borders;
pub mod bridge;
pub mod brute_force;
pub mod concurrency;
pub mod crossing_balls;
pub mod diffusion_starts;
pub mod disturbance;
pub mod fake_robot;
pub mod fnv1a;
pub mod geometry;
pub mod judge;
pub mod kills;
pub mod knots;
pub mod listener;
pub mod mixed_requests;
pub mod motion;
pub mod moving_target;
pub mod other_user;
pub mod outside;
pub mod passages;
pub mod plain_client;
pub mod played_controller;
pub mod priority;
pub mod process;
pub mod programs;
pub mod raw;
pub mod raw_daemon;
pub mod raw_scene;
pub mod recording;
pub mod replans;
pub mod retries;
pub mod rounds;
pub mod servo_bank;
pub mod servo_stack;
pub mod shortest_stop;
pub mod stack;
pub mod stalled_output;
pub mod starts;
pub mod supervision;
pub mod system_calls;
pub mod trial;
pub mod usage;
pub mod world;
