//! The ports of the goal that stays.

use shared_types::PROTOCOL_VERSION;
use shared_types::clock::mono_now_ns;
use shared_types::ipc::{
    IpcError, IpcNode, Publisher, Subscriber, goal_service, goal_status_service,
    motion_result_service, publisher, subscriber,
};
use shared_types::message::{GoalStatus, MotionResult, StandingGoal};

/// Most messages that are taken in one round, so that an endless sender cannot hold the receiver.
const TAKEN_AT_ONCE: usize = 64;

/// Goals and results of motions come in, the goal's status goes out. They stay in the thread that made them.
pub(crate) struct GoalPorts {
    goals: Subscriber<StandingGoal>,
    results: Subscriber<MotionResult>,
    statuses: Publisher<GoalStatus>,
    sending_fails: bool,
}

impl GoalPorts {
    /// Opens the services and makes the ports.
    ///
    /// # Errors
    /// [`IpcError`].
    pub(crate) fn open(node: &IpcNode) -> Result<Self, IpcError> {
        Ok(Self {
            goals: subscriber(node, &goal_service(node)?)?,
            results: subscriber(node, &motion_result_service(node)?)?,
            statuses: publisher(node, &goal_status_service(node)?)?,
            sending_fails: false,
        })
    }

    /// The next goal that has come, if any.
    pub(crate) fn goals(&self) -> impl Iterator<Item = StandingGoal> {
        let next = || self.goals.receive().ok().flatten();
        std::iter::from_fn(next)
            .take(TAKEN_AT_ONCE)
            .map(|sample| *sample)
    }

    /// The next result of a motion that has come, if any.
    pub(crate) fn results(&self) -> impl Iterator<Item = MotionResult> {
        let next = || self.results.receive().ok().flatten();
        std::iter::from_fn(next)
            .take(TAKEN_AT_ONCE)
            .map(|sample| *sample)
    }

    /// Publishes a status as that of now.
    pub(crate) fn publish(&mut self, status: GoalStatus) {
        let sent = self.statuses.send_copy(GoalStatus {
            stamp_mono_ns: mono_now_ns(),
            protocol_version: PROTOCOL_VERSION,
            ..status
        });
        if let Err(error) = &sent
            && !self.sending_fails
        {
            tracing::error!("the goal's status cannot be published: {error:?}");
        }
        self.sending_fails = sent.is_err();
    }
}
