//! The controller's process: three threads, each with one duty, and the rings between them.
//!
//! * the loop moves the robot, and depends on nothing that could hold it up;
//! * the guard stops the robot: commands, the loss of the daemon, the end of the process;
//! * the relay does everything else: trajectories, state, the log.
//!
//! [`run`] is that process; [`Follower`] lends its loop's part to a program that has a loop of its own.

mod commands;
mod config;
mod explain;
mod follower;
mod guard;
mod hard_loop;
mod link;
mod loop_services;
mod loop_step;
mod periodic_deadlines;
mod ports;
mod relay;
mod results;
mod view;
mod wire;

pub use config::ControllerConfig;
pub use follower::{FollowedCycle, Follower};
pub use guard::Signals;

use std::sync::{Arc, atomic::Ordering};

use shared_types::ipc::{IpcError, IpcOptions};
use tracing::info;

use hard_loop::LoopThread;
use loop_services::LoopServices;

/// Runs the controller until it is told to shut down; it then stops the robot along its path before it returns.
///
/// A thread that is held up does not keep the process from ending: it is left behind when this returns.
///
/// # Errors
/// [`IpcError::AlreadyRunning`] where another controller lives under the same prefix and root, or what a service or a
/// port failed with.
pub fn run(
    config: ControllerConfig,
    options: &IpcOptions,
    signals: Signals,
) -> Result<(), IpcError> {
    let config = Arc::new(config);
    let (mut services, loop_end) = LoopServices::start(&config, options, signals)?;
    let loop_options = options.clone();
    let open_loop = move || LoopThread::open(config, &loop_options, loop_end);
    services.add("hard-loop", open_loop, LoopThread::run)?;
    robot_driver::claim_shared_memory(options)?;
    services.wait_until_quitting();
    if services.shared().is_abandoned.load(Ordering::Relaxed) {
        return Err(IpcError::Failed {
            service: "controller".to_owned(),
            what: "hard-loop",
            reason: "it has made no cycle for 5 s; the robot, which was moving, is let go of and ramps to rest".to_owned(),
        });
    }
    drop(services);
    info!("ended");
    Ok(())
}
