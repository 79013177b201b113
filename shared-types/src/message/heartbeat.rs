//! Heartbeats.

use iceoryx2::prelude::ZeroCopySend;

use super::wire::wire_message;

wire_message! {
    /// A process is alive and its work goes on (service `heartbeat`, at least 50 Hz).
    pub struct Heartbeat: "pcc.v7.Heartbeat", 32 bytes {
        /// When the heartbeat was sent, nanoseconds of `CLOCK_MONOTONIC`.
        pub stamp_mono_ns: i64,
        /// Identifies the process among all that had this role since the machine was booted: its start time, nanoseconds of
        /// `CLOCK_MONOTONIC`. Trajectories name their daemon by it.
        pub instance: u64,
        /// Counts the sender's heartbeats, from 1.
        pub sequence: u64,
        /// [`crate::codes::ProcessKind`] of the sender.
        pub kind: u32,
        /// The sender's process id.
        pub pid: u32,
    }
}
