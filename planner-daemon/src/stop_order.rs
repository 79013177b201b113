//! Ordering the controller to stop, until it answers.

use iceoryx2::pending_response::PendingResponse;
use iceoryx2::prelude::{PortFactory, ipc};
use shared_types::codes::LoopState;
use shared_types::ipc::{
    CommandClient, CommandService, IpcError, IpcNode, command_client, command_service,
};
use shared_types::message;
use shared_types::valid::{Command, CommandReply};

use crate::supervision::StopReason;

/// Time after which an order without effect is given again, nanoseconds.
const REPEAT_NS: i64 = 50_000_000;
/// ... after one that had nothing to stop: the trajectory may still have been on its way.
const REPEAT_AFTER_REFUSAL_NS: i64 = 5_000_000;
/// Rounds of supervision without a reply after which the heart stops, which the controller takes for a lost daemon and stops by
/// itself: about 150 ms, in which the machine has not paused.
const ESCALATION_ROUNDS: u32 = 150;

type Pending = PendingResponse<ipc::Service, message::Command, (), message::CommandReply, ()>;

/// The daemon's client of `command`, and the order under way.
pub(crate) struct StopOrder {
    client: CommandClient,
    service: CommandService,
    pending: Option<Pending>,
    /// When the order may be given again, nanoseconds.
    again_mono_ns: i64,
    /// The motion that is being stopped; 0: none yet.
    trajectory_id: u32,
    /// Rounds since the first order for this motion, or since the last reply.
    unanswered_rounds: u32,
    count: u64,
}

impl StopOrder {
    /// Opens the service and makes the client.
    pub(crate) fn open(node: &IpcNode) -> Result<Self, IpcError> {
        let service = command_service(node)?;
        Ok(Self {
            client: command_client(node, &service)?,
            service,
            pending: None,
            again_mono_ns: i64::MIN,
            trajectory_id: 0,
            unanswered_rounds: 0,
            count: 0,
        })
    }

    /// Whether anybody serves `command`, so that an order could arrive.
    pub(crate) fn can_be_given(&self) -> bool {
        self.service.dynamic_config().number_of_servers() > 0
    }

    /// Orders a stop, unless one was ordered a moment ago and may still be answered. Call it every round until it is obeyed.
    pub(crate) fn give(&mut self, trajectory_id: u32, reason: StopReason, now_mono_ns: i64) {
        let is_first = self.trajectory_id != trajectory_id;
        if is_first {
            self.trajectory_id = trajectory_id;
            self.unanswered_rounds = 0;
        } else {
            self.unanswered_rounds = self.unanswered_rounds.saturating_add(1);
            if now_mono_ns < self.again_mono_ns {
                return;
            }
        }
        self.again_mono_ns = now_mono_ns.saturating_add(REPEAT_NS);
        self.count += 1;
        let sent = self.client.send_copy(Command::Stop.to_wire(self.count));
        if is_first {
            tracing::warn!(
                "{reason}: the controller is ordered to stop trajectory {trajectory_id}"
            );
        }
        match sent {
            Ok(pending) => {
                if is_first && pending.number_of_server_connections() == 0 {
                    tracing::error!("nobody takes the order to stop: it is given again and again");
                }
                self.pending = Some(pending);
            }
            Err(error) if is_first => {
                tracing::error!("the stop could not be ordered: {error:?}");
            }
            Err(_) => {}
        }
    }

    /// Whether orders have stayed without reply for so long that the controller has to find out by itself.
    pub(crate) fn is_ignored(&self) -> bool {
        self.unanswered_rounds > ESCALATION_ROUNDS
    }

    /// Forgets the motion that was to be stopped: it is over.
    pub(crate) fn end(&mut self) {
        self.pending = None;
        self.unanswered_rounds = 0;
    }

    /// Hears the controller's reply; whether it just said that by this order nothing moves and nothing will: one that had begun
    /// brakes first.
    pub(crate) fn attend(&mut self, now_mono_ns: i64) -> bool {
        let Some(pending) = &self.pending else {
            return false;
        };
        let reply: message::CommandReply = match pending.receive() {
            Ok(Some(response)) => *response,
            Ok(None) => return false,
            Err(error) => {
                tracing::error!("the controller's reply cannot be received: {error:?}");
                self.pending = None;
                return false;
            }
        };
        self.pending = None;
        self.unanswered_rounds = 0;
        match CommandReply::try_from(&reply) {
            Ok(reply) if reply.accepted => {
                tracing::info!("the controller obeys the order to stop");
                return matches!(reply.state, LoopState::Holding | LoopState::Fault);
            }
            Ok(reply) => tracing::debug!("the controller does not stop: {}", reply.reason),
            Err(error) => tracing::warn!("the controller's reply is refused: {error}"),
        }
        self.again_mono_ns = now_mono_ns.saturating_add(REPEAT_AFTER_REFUSAL_NS);
        false
    }
}
