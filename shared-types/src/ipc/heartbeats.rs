//! The heartbeats of a process, by which others know that it lives.

use codes::ProcessKind;
use iceoryx2::port::SendError;
use iceoryx2::port::update_connections::{ConnectionFailure, UpdateConnections};

use super::{IpcError, IpcNode, Publisher, heartbeat_service, publisher};
use crate::clock::mono_now_ns;
use crate::message::Heartbeat;

/// Sends heartbeats of one process.
pub struct Heartbeats {
    port: Publisher<Heartbeat>,
    kind: ProcessKind,
    sent: u64,
}

impl Heartbeats {
    /// Opens the port.
    ///
    /// # Errors
    /// [`IpcError`] where the service or the port cannot be opened.
    pub fn open(node: &IpcNode, kind: ProcessKind) -> Result<Self, IpcError> {
        Ok(Self {
            port: publisher(node, &heartbeat_service(node)?)?,
            kind,
            sent: 0,
        })
    }

    /// Sends a heartbeat of the process with this instance number.
    ///
    /// # Errors
    /// What iceoryx2 says where it cannot be sent.
    pub fn send(&mut self, instance: u64) -> Result<(), SendError> {
        self.sent += 1;
        let beat = Heartbeat {
            stamp_mono_ns: mono_now_ns(),
            instance,
            sequence: self.sent,
            kind: self.kind.code(),
            pid: std::process::id(),
        };
        self.port.send_copy(beat).map(|_| ())
    }

    /// Connects listeners that have come since.
    ///
    /// # Errors
    /// What iceoryx2 says where a listener cannot be connected.
    pub fn update_connections(&self) -> Result<(), ConnectionFailure> {
        self.port.update_connections()
    }
}
