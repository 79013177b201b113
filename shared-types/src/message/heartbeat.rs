//! Signs of life.

use iceoryx2::prelude::ZeroCopySend;

use super::wire_message;

wire_message! {
    /// A process is alive and its work goes on (service `heartbeat`, at least 50 Hz).
    pub struct Heartbeat: "pcc.v3.Heartbeat", 32 bytes {
        /// When it was sent, nanoseconds of `CLOCK_MONOTONIC`.
        pub stamp_mono_ns: i64,
        /// Another number for each process of its kind that was started since the machine was: a trajectory names the daemon that
        /// has published it by this one.
        pub instance: u64,
        /// Counts the sender's heartbeats, from 1.
        pub sequence: u64,
        /// [`crate::codes::ProcessKind`] of the sender.
        pub kind: u32,
        /// Its process id.
        pub pid: u32,
    }
}
