//! Who asks for a plan.

use iceoryx2::identifiers::UniqueClientId;
use shared_types::ipc::PlanActiveRequest;
use shared_types::message::PlanRequest;

/// Who asks for a plan, and is answered.
pub(super) enum Asker {
    /// A client, whose request is open until it was answered.
    Client(PlanActiveRequest),
    /// The keeper of the goal that stays, and what it asks for.
    GoalKeeper(Box<PlanRequest>),
}

/// By what one who asks is known in the queue.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum AskerId {
    Client(UniqueClientId),
    GoalKeeper,
}

impl Asker {
    pub(super) fn id(&self) -> AskerId {
        match self {
            Self::Client(active) => AskerId::Client(active.origin()),
            Self::GoalKeeper(_) => AskerId::GoalKeeper,
        }
    }

    /// Whether it still waits for the answer.
    pub(super) fn is_waiting(&self) -> bool {
        match self {
            Self::Client(active) => is_open(active),
            Self::GoalKeeper(_) => true,
        }
    }
}

/// Whether a client still waits for the answer to its request.
pub(super) fn is_open(active: &PlanActiveRequest) -> bool {
    active.is_connected() && !active.has_disconnect_hint()
}
