//! A request to execute a motion, sent to the supervision thread, and its reply.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::SyncSender;

use trajectory::Trajectory;

use super::refusal::ExecutionRefusal;
use super::robot_motion::{Switch, TimedGoal};

/// When a motion was asked for, and when it is to begin, nanoseconds of `CLOCK_MONOTONIC`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ExecutionTiming {
    /// When the sender of the request was asked for it.
    pub(crate) requested_mono_ns: i64,
    /// The earliest begin; none: as soon as possible.
    pub(crate) begin_mono_ns: Option<i64>,
}

/// The selected candidate's motion, to be executed.
pub(crate) struct SelectedMotion {
    pub(crate) motion: Arc<Trajectory>,
    /// Its goals, in their order.
    pub(crate) goals: Arc<[TimedGoal]>,
    /// Where it leaves the motion that is followed; none where it begins at rest.
    pub(crate) leaves: Option<Switch>,
    pub(crate) draw: usize,
    pub(crate) plan_id: u64,
    /// Whether another motion is planned as soon as this one is not certified to its end any more.
    pub(crate) is_replanned: bool,
    pub(crate) timing: ExecutionTiming,
}

/// A reply that is either delivered or abandoned, never both: the caller that stops waiting learns whether its motion was published.
#[derive(Debug, Default)]
pub(crate) struct ReplySlot(AtomicU64);

impl ReplySlot {
    /// Neither delivered (ids are u32, at least 1) nor abandoned.
    const OPEN: u64 = 0;
    const ABANDONED: u64 = u64::MAX;

    /// Delivers the id; false where the caller has abandoned the reply.
    pub(crate) fn deliver(&self, id: u32) -> bool {
        self.settle(u64::from(id)).is_ok()
    }

    /// Abandons the reply; returns the id where it was delivered before.
    pub(super) fn abandon(&self) -> Option<u32> {
        let delivered = self.settle(Self::ABANDONED).err()?;
        u32::try_from(delivered).ok()
    }

    fn settle(&self, value: u64) -> Result<u64, u64> {
        let order = Ordering::AcqRel;
        self.0
            .compare_exchange(Self::OPEN, value, order, Ordering::Acquire)
    }
}

/// A motion for the supervision thread to publish, and where to reply.
pub(crate) struct ExecutionRequest {
    pub(crate) selected: SelectedMotion,
    /// Latest time of publication, nanoseconds of `CLOCK_MONOTONIC`.
    pub(crate) until_mono_ns: i64,
    pub(crate) slot: Arc<ReplySlot>,
    pub(crate) answer: SyncSender<Result<u32, ExecutionRefusal>>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_id_is_told_or_given_up_and_never_both() {
        let told = ReplySlot::default();
        assert!(told.deliver(7));
        assert_eq!(told.abandon(), Some(7));
        let given_up = ReplySlot::default();
        assert_eq!(given_up.abandon(), None);
        assert!(!given_up.deliver(7));
        assert_eq!(given_up.abandon(), None);
    }
}
