//! Ordering the controller to stop, until it answers.

use iceoryx2::pending_response::PendingResponse;
use iceoryx2::prelude::ipc;
use shared_types::ipc::{CommandClient, IpcError, IpcNode, command_client, command_service};
use shared_types::message;
use shared_types::valid::{Command, CommandReply};

/// Time after which an order without effect is given again, nanoseconds.
const REPEAT_NS: i64 = 50_000_000;

type Pending = PendingResponse<ipc::Service, message::Command, (), message::CommandReply, ()>;

/// The daemon's client of `command`, and the order under way.
pub(crate) struct StopOrder {
    client: CommandClient,
    pending: Option<Pending>,
    given_mono_ns: i64,
    count: u64,
}

impl StopOrder {
    /// Opens the service and makes the client.
    pub(crate) fn open(node: &IpcNode) -> Result<Self, IpcError> {
        Ok(Self {
            client: command_client(node, &command_service(node)?)?,
            pending: None,
            given_mono_ns: i64::MIN,
            count: 0,
        })
    }

    /// Orders a stop, unless one was ordered a moment ago.
    pub(crate) fn give(&mut self, trajectory_id: u32, now_mono_ns: i64) {
        if now_mono_ns.saturating_sub(self.given_mono_ns) < REPEAT_NS {
            return;
        }
        self.given_mono_ns = now_mono_ns;
        self.count += 1;
        tracing::warn!(
            "the live scene is in the way of trajectory {trajectory_id}: the controller is ordered to stop"
        );
        match self.client.send_copy(Command::Stop.to_wire(self.count)) {
            Ok(pending) => self.pending = Some(pending),
            Err(error) => tracing::error!("the stop could not be ordered: {error:?}"),
        }
    }

    /// Hears the controller's reply; whether it just said that the order takes effect.
    pub(crate) fn attend(&mut self, now_mono_ns: i64) -> bool {
        let Some(pending) = &self.pending else {
            return false;
        };
        let waits = now_mono_ns.saturating_sub(self.given_mono_ns) < REPEAT_NS;
        let reply: Option<message::CommandReply> = match pending.receive() {
            Ok(Some(response)) => Some(*response),
            Ok(None) if waits => return false,
            Ok(None) => {
                tracing::error!("the controller did not reply to the order to stop");
                None
            }
            Err(error) => {
                tracing::error!("the controller's reply cannot be received: {error:?}");
                None
            }
        };
        self.pending = None;
        reply.as_ref().is_some_and(is_obeyed)
    }
}

fn is_obeyed(reply: &message::CommandReply) -> bool {
    match CommandReply::try_from(reply) {
        Ok(reply) if reply.accepted => {
            tracing::info!("the controller obeys the order to stop");
            return true;
        }
        Ok(reply) => tracing::warn!("the controller does not stop: {}", reply.reason),
        Err(error) => tracing::warn!("the controller's reply is refused: {error}"),
    }
    false
}
