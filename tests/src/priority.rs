//! Real-time priorities of threads that ask or watch.
#![allow(unsafe_code, reason = "no safe interface without another crate")]

use std::io;

/// Of who watches: below those of the controller's and the robot's loops, above the daemon and its clients.
pub const OF_A_WATCH: u8 = 60;
/// Of a client: above the daemon's.
pub const OF_A_CLIENT: u8 = 50;
/// Of the daemon's planning.
pub const OF_PLANNING: u8 = 10;

/// Runs this thread under SCHED_FIFO with `priority` from now on.
///
/// # Errors
/// The system's answer, where it does not permit that.
pub fn raise_priority(priority: u8) -> io::Result<()> {
    let parameters = libc::sched_param {
        sched_priority: priority.into(),
    };
    // SAFETY: `parameters` outlives the call; 0 is the calling thread.
    match unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &raw const parameters) } {
        0 => Ok(()),
        _ => Err(io::Error::last_os_error()),
    }
}
