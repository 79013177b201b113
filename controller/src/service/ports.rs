//! The relay thread's ports.

use iceoryx2::port::update_connections::UpdateConnections;
use shared_types::{
    codes::ProcessKind,
    ipc::{self, CyclePublisher, Heartbeats, IpcError, IpcNode, IpcOptions, Publisher, Subscriber},
    message::{ControllerState, Cycle, MotionResult, TrajectoryMessage},
};
use tracing::debug;

/// Ports of the relay thread.
pub(super) struct Ports {
    trajectory: Subscriber<TrajectoryMessage>,
    heartbeats: Heartbeats,
    state: Publisher<ControllerState>,
    results: Publisher<MotionResult>,
    cycles: CyclePublisher,
    // Declared last: the node outlives its ports.
    _node: IpcNode,
}

impl Ports {
    pub(super) fn open(options: &IpcOptions) -> Result<Self, IpcError> {
        let node = IpcNode::create(options, "controller-relay")?;
        Ok(Self {
            trajectory: ipc::subscriber(&node, &ipc::trajectory_service(&node)?)?,
            heartbeats: Heartbeats::open(&node, ProcessKind::Controller)?,
            state: ipc::publisher(&node, &ipc::controller_state_service(&node)?)?,
            results: ipc::publisher(&node, &ipc::motion_result_service(&node)?)?,
            cycles: ipc::cycle_publisher(&node, &ipc::cycle_service(&node)?)?,
            _node: node,
        })
    }

    /// Copies the next trajectory that has arrived; false where there is none.
    ///
    /// Shared memory can change under a reader, so only the copy is read.
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

    pub(super) fn send_state(&self, state: &ControllerState) {
        if let Err(error) = self.state.send_copy(*state) {
            debug!(?error, "cannot send the state");
        }
    }

    pub(super) fn send_heartbeat(&mut self, instance: u64) {
        if let Err(error) = self.heartbeats.send(instance) {
            debug!(?error, "cannot send a heartbeat");
        }
    }

    /// Sends the result of a motion; false where it cannot be sent now.
    pub(super) fn send_result(&self, result: &MotionResult) -> bool {
        let sent = self.results.send_copy(*result);
        if let Err(error) = &sent {
            debug!(?error, "cannot send the result of a motion");
        }
        sent.is_ok()
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

    /// Connects to new processes, which sends them the history.
    pub(super) fn update_connections(&self) {
        // A peer that cannot be connected now is tried again next time.
        let _ = self.state.update_connections();
        let _ = self.results.update_connections();
        let _ = self.cycles.update_connections();
        let _ = self.heartbeats.update_connections();
    }
}
