//! Ordering the controller to stop, until it answers.

use iceoryx2::pending_response::PendingResponse;
use iceoryx2::prelude::{PortFactory, ipc};
use shared_types::codes::{CommandRefusal, CommandSender, LoopState};
use shared_types::ipc::{
    CommandClient, CommandService, IpcError, IpcNode, command_client, command_service,
};
use shared_types::message::{self, ReasonText};
use shared_types::valid::{Command, CommandReply, Signature, SignedCommand};

use super::heartbeat::STALL_NS;
use super::stop_reason::StopReason;
use crate::live_scene::{HEARTBEAT_TIMEOUT_NS, UNSUPERVISED_S};

/// Time after which an order is given again while a stop is still wanted, nanoseconds: a controller whose loop is held answers after
/// 51 ms, and a later order takes the place of one that is not answered. A stop for which the controller has nothing to stop is not answered either.
const REPEAT_NS: i64 = 60_000_000;
/// Time after which an order is given again where the controller has answered that it does not stop, nanoseconds.
const REPEAT_AFTER_REFUSAL_NS: i64 = 5_000_000;
/// Time without a reply after which supervision makes no progress, so that the heart stops, which the controller takes for a lost
/// daemon and stops by itself; nanoseconds of [`ActiveTime`](super::active_time::ActiveTime).
const ESCALATION_NS: i64 = 40_000_000;
/// Time that the periods of supervision, heartbeat and controller add between an unanswered order and the stop, nanoseconds.
const ROUNDS_NS: i64 = 10_000_000;
// A motion goes on for 40 + 100 + 200 + 10 ms then; moving balls are avoided for 350.
const _: () = assert!(
    ESCALATION_NS + STALL_NS + HEARTBEAT_TIMEOUT_NS + ROUNDS_NS <= (UNSUPERVISED_S * 1e9) as i64
);

type Pending = PendingResponse<ipc::Service, message::Command, (), message::CommandReply, ()>;

/// Time for which a wanted stop has had no reply: from the first order for a motion, or from the last reply, on.
#[derive(Debug, Default)]
struct UnansweredTime {
    total_ns: i64,
    wanted_active_ns: Option<i64>,
}

impl UnansweredTime {
    /// Counts the time since the last call; `active_ns` is the active time of supervision now.
    fn wanted(&mut self, active_ns: i64) {
        let last = self.wanted_active_ns.replace(active_ns);
        self.total_ns += last.map_or(0, |last| active_ns - last);
    }

    /// The order is not wanted: the time until the next call of `wanted` does not count.
    fn unwanted(&mut self) {
        self.wanted_active_ns = None;
    }

    fn is_too_long(&self) -> bool {
        self.total_ns > ESCALATION_NS
    }
}

/// The daemon's client of `command`, and the order under way.
pub(crate) struct StopOrder {
    client: CommandClient,
    service: CommandService,
    pending: Option<Pending>,
    /// When the order may be given again, nanoseconds.
    again_mono_ns: i64,
    /// The motion that is being stopped; 0: none yet.
    trajectory_id: u32,
    unanswered: UnansweredTime,
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
            unanswered: UnansweredTime::default(),
            count: 0,
        })
    }

    /// Whether anybody serves `command`, so that an order could arrive.
    pub(crate) fn can_be_given(&self) -> bool {
        self.service.dynamic_config().number_of_servers() > 0
    }

    /// Orders a stop of `trajectory_id`, unless the last order may still be answered. Call every round while the stop is wanted;
    /// `active_ns` is the supervision thread's active time, ns.
    pub(crate) fn send(
        &mut self,
        trajectory_id: u32,
        reason: StopReason,
        now_mono_ns: i64,
        active_ns: i64,
    ) {
        let is_first = self.trajectory_id != trajectory_id;
        if is_first {
            self.end();
            self.trajectory_id = trajectory_id;
        }
        self.unanswered.wanted(active_ns);
        if !is_first && now_mono_ns < self.again_mono_ns {
            return;
        }
        self.again_mono_ns = now_mono_ns.saturating_add(REPEAT_NS);
        self.count += 1;
        let order = SignedCommand {
            command: Command::Stop,
            signature: Signature {
                sender: CommandSender::Supervision,
                sender_pid: std::process::id(),
                reason: ReasonText::new(&reason.to_string()),
            },
        };
        let sent = self.client.send_copy(order.to_wire(self.count));
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

    /// Whether orders to stop have stayed without reply for too long, so that heartbeats are to end and the controller is to stop by itself.
    pub(crate) fn is_ignored(&self) -> bool {
        self.unanswered.is_too_long()
    }

    /// States that no stop is wanted now: the controller is braking, or the reason has gone.
    pub(crate) fn pause(&mut self) {
        self.unanswered.unwanted();
    }

    /// Forgets the motion that was to be stopped: it is over.
    pub(crate) fn end(&mut self) {
        self.pending = None;
        self.trajectory_id = 0;
        self.unanswered = UnansweredTime::default();
    }

    /// Hears the controller's reply to the order. Returns whether a reply has come that says that the robot is at rest; nothing
    /// that was requested before the order moves it then. While a motion that had begun brakes, no reply says so.
    pub(crate) fn poll_reply(&mut self, now_mono_ns: i64) -> bool {
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
        self.unanswered = UnansweredTime::default();
        match CommandReply::try_from(&reply) {
            Ok(reply) if reply.accepted => {
                tracing::info!("the controller obeys the order to stop");
                return is_at_rest(&reply);
            }
            Ok(reply) if reply.refusal == CommandRefusal::NothingToDo && is_at_rest(&reply) => {
                tracing::info!("the controller has nothing to stop");
                self.again_mono_ns = now_mono_ns.saturating_add(REPEAT_NS);
                return true;
            }
            Ok(reply) => tracing::debug!("the controller does not stop: {}", reply.reason),
            Err(error) => tracing::warn!("the controller's reply is refused: {error}"),
        }
        self.again_mono_ns = now_mono_ns.saturating_add(REPEAT_AFTER_REFUSAL_NS);
        false
    }
}

/// Whether the reply says that the robot is at rest. The controller refuses whatever was requested before the stop.
fn is_at_rest(reply: &CommandReply) -> bool {
    matches!(
        reply.state,
        LoopState::Holding | LoopState::Fault | LoopState::Starting
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    #[test]
    fn the_controller_misses_the_heart_as_shipped() {
        let shipped = include_str!("../../../config/controller.toml");
        let line = format!("\ndaemon_lost_ms = {}\n", HEARTBEAT_TIMEOUT_NS / MS);
        assert!(shipped.contains(&line), "{line}");
    }

    #[test]
    fn an_order_is_ignored_after_its_time_however_often_it_is_looked_at() {
        let mut unanswered = UnansweredTime::default();
        for _ in 0..1_000 {
            unanswered.wanted(7 * MS);
        }
        assert!(!unanswered.is_too_long());
        unanswered.wanted(7 * MS + ESCALATION_NS);
        assert!(!unanswered.is_too_long());
        unanswered.wanted(8 * MS + ESCALATION_NS);
        assert!(unanswered.is_too_long());
    }

    #[test]
    fn time_in_which_no_stop_is_wanted_does_not_count() {
        let mut unanswered = UnansweredTime::default();
        unanswered.wanted(0);
        unanswered.unwanted();
        unanswered.wanted(900 * MS);
        assert!(!unanswered.is_too_long());
    }
}
