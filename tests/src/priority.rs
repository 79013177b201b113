//! Real-time priority for threads that watch others.
#![allow(unsafe_code, reason = "no safe interface without another crate")]

use std::io;

/// Below that of the controller's loop, above ordinary programs.
const PRIORITY: libc::c_int = 60;

/// Runs this thread under SCHED_FIFO from now on.
///
/// # Errors
/// The system's answer, where it does not permit that.
pub fn raise_priority() -> io::Result<()> {
    let parameters = libc::sched_param {
        sched_priority: PRIORITY,
    };
    // SAFETY: `parameters` outlives the call; 0 is the calling thread.
    match unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &raw const parameters) } {
        0 => Ok(()),
        _ => Err(io::Error::last_os_error()),
    }
}
