//! The relay thread's ports: what others come and go on.

use iceoryx2::port::update_connections::UpdateConnections;
use shared_types::{
    clock::mono_now_ns,
    codes::ProcessKind,
    ipc::{self, CyclePublisher, IpcError, IpcNode, IpcOptions, Publisher, Subscriber},
    message::{ControllerState, Cycle, Heartbeat, TrajectoryMessage},
};
use tracing::debug;

/// Ports of the relay thread.
pub(super) struct Ports {
    trajectory: Subscriber<TrajectoryMessage>,
    heartbeat: Publisher<Heartbeat>,
    state: Publisher<ControllerState>,
    cycles: CyclePublisher,
    heartbeat_sequence: u64,
    // Declared last: the node outlives its ports.
    node: IpcNode,
}

impl Ports {
    pub(super) fn open(options: &IpcOptions) -> Result<Self, IpcError> {
        let node = IpcNode::create(options, "controller-relay")?;
        Ok(Self {
            trajectory: ipc::subscriber(&node, &ipc::trajectory_service(&node)?)?,
            heartbeat: ipc::publisher(&node, &ipc::heartbeat_service(&node)?)?,
            state: ipc::publisher(&node, &ipc::controller_state_service(&node)?)?,
            cycles: ipc::cycle_publisher(&node, &ipc::cycle_service(&node)?)?,
            heartbeat_sequence: 0,
            node,
        })
    }

    /// Copies the next trajectory that has arrived; false where there is none.
    ///
    /// Shared memory can change under a reader: only the copy is looked at.
    pub(super) fn next_trajectory(&self, copy: &mut TrajectoryMessage) -> bool {
        match self.trajectory.receive() {
            Ok(Some(sample)) => {
                *copy = *sample;
                true
            }
            Ok(None) => false,
            Err(error) => {
                debug!(?error, "cannot receive a trajectory");
                false
            }
        }
    }

    pub(super) fn send_heartbeat(&mut self, instance: u64) {
        self.heartbeat_sequence += 1;
        let beat = Heartbeat {
            stamp_mono_ns: mono_now_ns(),
            instance,
            sequence: self.heartbeat_sequence,
            kind: ProcessKind::Controller.code(),
            pid: std::process::id(),
        };
        if let Err(error) = self.heartbeat.send_copy(beat) {
            debug!(?error, "cannot send a heartbeat");
        }
    }

    pub(super) fn send_state(&self, state: &ControllerState) {
        if let Err(error) = self.state.send_copy(*state) {
            debug!(?error, "cannot send the state");
        }
    }

    /// Sends `cycles`, at most [`ipc::CYCLES_PER_BATCH`] of them.
    pub(super) fn send_cycles(&self, cycles: &[Cycle]) {
        let sent = self
            .cycles
            .loan_slice_uninit(cycles.len())
            .map_err(|error| format!("{error:?}"))
            .and_then(|loan| {
                loan.write_from_slice(cycles)
                    .send()
                    .map_err(|error| format!("{error:?}"))
            });
        if let Err(error) = sent {
            debug!(error, "cannot send cycles");
        }
    }

    /// Removes what dead processes left, and connects to new ones (which pushes them the history).
    pub(super) fn tidy(&self) {
        self.node.clean_dead_nodes();
        // A peer that cannot be connected now is tried again next time.
        let _ = self.state.update_connections();
        let _ = self.cycles.update_connections();
        let _ = self.heartbeat.update_connections();
    }
}
