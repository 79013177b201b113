//! Records of requests and answers, for recorders.

use std::cell::Cell;

use shared_types::clock::mono_now_ns;
use shared_types::ipc::{IpcError, IpcNode, Publisher, Topic, plan_record_service, publisher};
use shared_types::message::{PlanRecord, PlanRequest};

use super::answer::Answer;

/// Publishes a record of each answer.
pub(super) struct PlanRecords {
    topic: Topic<PlanRecord>,
    publisher: Publisher<PlanRecord>,
    instance: u64,
    sequence: Cell<u64>,
}

impl PlanRecords {
    /// Opens `plan_record` for this instance of the daemon.
    ///
    /// # Errors
    /// [`IpcError`].
    pub(super) fn open(node: &IpcNode, instance: u64) -> Result<Self, IpcError> {
        let topic = plan_record_service(node)?;
        Ok(Self {
            publisher: publisher(node, &topic)?,
            topic,
            instance,
            sequence: Cell::new(0),
        })
    }

    /// Tells of a request that was answered, of a client or for the goal that stays; recorders that are slow miss it.
    pub(super) fn publish(&self, request: &PlanRequest, answer: &Answer) {
        self.sequence.set(self.sequence.get() + 1);
        if self.topic.number_of_subscribers() == 0 {
            return;
        }
        let sent = self.publisher.send_copy(PlanRecord {
            sequence: self.sequence.get(),
            stamp_mono_ns: mono_now_ns(),
            instance: self.instance,
            depends_on: answer.depends_on.code().into(),
            start_configuration_rad: answer.start.into(),
            request: *request,
            report: answer.report,
        });
        if let Err(error) = sent {
            tracing::debug!("a plan is not recorded: {error:?}");
        }
    }
}
