//! The heartbeats of a process, by which others know that it lives.

use shared_types::{
    clock::mono_now_ns,
    codes::ProcessKind,
    ipc::{self, IpcError, IpcNode, Publisher},
    message::Heartbeat,
};
use tracing::debug;

/// Sends heartbeats of one process.
pub(crate) struct Heartbeats {
    /// The port that heartbeats are sent through.
    pub(crate) port: Publisher<Heartbeat>,
    kind: ProcessKind,
    sent: u64,
}

impl Heartbeats {
    /// Opens the port.
    ///
    /// # Errors
    /// [`IpcError`] where the service or the port cannot be opened.
    pub(crate) fn open(node: &IpcNode, kind: ProcessKind) -> Result<Self, IpcError> {
        Ok(Self {
            port: ipc::publisher(node, &ipc::heartbeat_service(node)?)?,
            kind,
            sent: 0,
        })
    }

    /// Sends a heartbeat of the process with this instance number.
    pub(crate) fn send(&mut self, instance: u64) {
        self.sent += 1;
        let beat = Heartbeat {
            stamp_mono_ns: mono_now_ns(),
            instance,
            sequence: self.sent,
            kind: self.kind.code(),
            pid: std::process::id(),
        };
        if let Err(error) = self.port.send_copy(beat) {
            debug!(?error, "cannot send a heartbeat");
        }
    }
}
