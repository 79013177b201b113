//! Shared memory that a process claims before the robot moves.

use std::io;

use shared_types::ipc::{IpcError, IpcOptions};
use tracing::warn;

/// Gives the process all pages of its shared memory: one that is first written to when `/dev/shm` is full ends the process (SIGBUS).
///
/// # Errors
/// [`IpcError::Failed`]: there is no room for them.
pub fn claim_shared_memory(options: &IpcOptions) -> Result<(), IpcError> {
    match realtime::prefault_shared_memory(&options.prefix) {
        Err(error) if error.kind() == io::ErrorKind::InvalidInput => {
            warn!("before Linux 5.14 a full /dev/shm can end this process while the robot moves");
            Ok(())
        }
        Err(error) => Err(IpcError::Failed {
            service: options.prefix.clone(),
            what: "shared memory",
            reason: format!(
                "no room for it in /dev/shm ({error}); `df /dev/shm` shows what is free"
            ),
        }),
        Ok(_) => Ok(()),
    }
}
