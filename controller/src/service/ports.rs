//! The relay thread's ports: everything that others come and go on.

use iceoryx2::port::update_connections::UpdateConnections;
use shared_types::{
    clock::mono_now_ns,
    codes::ProcessKind,
    ipc::{
        self, CommandServer, CyclePublisher, IpcError, IpcNode, IpcOptions, Publisher, Subscriber,
    },
    message::{ControllerState, Cycle, Heartbeat, TrajectoryMessage},
    valid,
};
use tracing::debug;

/// Ports of the relay thread.
pub(super) struct Ports {
    pub(super) commands: CommandServer,
    trajectory: Subscriber<TrajectoryMessage>,
    heartbeats: Subscriber<Heartbeat>,
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
        let heartbeats = ipc::heartbeat_service(&node)?;
        Ok(Self {
            commands: ipc::command_server(&node, &ipc::command_service(&node)?)?,
            trajectory: ipc::subscriber(&node, &ipc::trajectory_service(&node)?)?,
            heartbeat: ipc::publisher(&node, &heartbeats)?,
            heartbeats: ipc::subscriber(&node, &heartbeats)?,
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

    /// The daemon's newest heartbeat that has arrived; one from the future would never grow old, and is none.
    pub(super) fn newest_daemon_heartbeat(&self) -> Option<valid::Heartbeat> {
        let mut newest: Option<valid::Heartbeat> = None;
        while let Ok(Some(sample)) = self.heartbeats.receive() {
            let copy = *sample;
            let Ok(beat) = valid::Heartbeat::try_from(&copy) else {
                continue;
            };
            let newer = newest.is_none_or(|newest| newest.stamp_mono_ns <= beat.stamp_mono_ns);
            if beat.kind == ProcessKind::Daemon && newer && beat.stamp_mono_ns <= mono_now_ns() {
                newest = Some(beat);
            }
        }
        newest
    }

    pub(super) fn send_heartbeat(&mut self) {
        self.heartbeat_sequence += 1;
        let beat = Heartbeat {
            stamp_mono_ns: mono_now_ns(),
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
