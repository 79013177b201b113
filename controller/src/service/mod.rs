//! The controller's process: a loop thread, a relay thread, and the rings between them.

mod config;
mod hard_loop;
mod link;
mod ports;
mod relay;
mod view;
mod wire;

pub use config::ControllerConfig;

use std::{
    panic::resume_unwind,
    sync::{atomic::AtomicBool, mpsc},
    thread,
};

use shared_types::ipc::{IpcError, IpcOptions, Role, RoleLock};
use tracing::info;

use crate::realtime;

/// Runs the controller until `shutdown` is set; it then stops the robot along its path before it returns.
///
/// The calling thread becomes the relay thread.
///
/// # Errors
/// [`IpcError::AlreadyRunning`] where another controller lives under the same prefix and root, or what a service or a
/// port failed with.
pub fn run(
    config: &ControllerConfig,
    options: &IpcOptions,
    shutdown: &AtomicBool,
) -> Result<(), IpcError> {
    let _role = RoleLock::acquire(options, Role::Controller)?;
    let (loop_end, relay_end) = link::link();
    let mut relay = relay::Relay::open(config, options, relay_end)?;
    thread::scope(|scope| {
        let (tell, told) = mpsc::channel();
        let hard_loop = thread::Builder::new()
            .name("hard-loop".to_owned())
            .spawn_scoped(scope, move || {
                // The receiver waits for it.
                let _ = tell.send(realtime::thread_id());
                hard_loop::run(config, options, loop_end)
            })
            .map_err(|error| IpcError::Failed {
                service: "controller".to_owned(),
                what: "the loop thread",
                reason: error.to_string(),
            })?;
        if let Ok(thread_id) = told.recv() {
            relay.set_loop_thread(thread_id);
        }
        relay.serve(shutdown, || hard_loop.is_finished());
        hard_loop
            .join()
            .unwrap_or_else(|panic| resume_unwind(panic))
    })?;
    info!("ended");
    Ok(())
}
