//! How motions ended.

use std::collections::VecDeque;
use std::thread;
use std::time::Duration;

use shared_types::ipc::{
    IpcNode, IpcOptions, Role, Subscriber, guest_subscriber, motion_result_service,
    observer_subscriber,
};
use shared_types::message;
use shared_types::valid::MotionResult;

use crate::ClientError;
use crate::view::{CONTROLLER, Subscribe, checked, receive};
use crate::waiting::{Cleaner, TimeLimit, wait};

/// Results that are kept.
const KEPT: usize = 64;
/// Time between two looks for a result.
const LOOK_INTERVAL: Duration = Duration::from_millis(1);

/// The results of motions: one of each trajectory that a controller has received. It knows those that came since it connected, and the
/// last eight before.
#[derive(Debug)]
pub struct ResultView {
    results: Subscriber<message::MotionResult>,
    recent: VecDeque<MotionResult>,
    cleaner: Cleaner,
    node: IpcNode,
}

impl ResultView {
    /// Joins the service; the controller need not run yet.
    ///
    /// # Errors
    /// [`ClientError::Ipc`].
    pub fn connect(options: &IpcOptions) -> Result<Self, ClientError> {
        Self::join(options, guest_subscriber)
    }

    /// Joins like [`connect`](Self::connect) for a program that only watches: it leaves places free for those that act.
    ///
    /// # Errors
    /// [`ClientError::Ipc`].
    pub fn watch(options: &IpcOptions) -> Result<Self, ClientError> {
        Self::join(options, observer_subscriber)
    }

    fn join(
        options: &IpcOptions,
        subscribe: Subscribe<message::MotionResult>,
    ) -> Result<Self, ClientError> {
        let node = IpcNode::create(options, "pcc-result-view")?;
        let results = subscribe(&node, &motion_result_service(&node)?)?;
        Ok(Self {
            results,
            recent: VecDeque::with_capacity(KEPT),
            cleaner: Cleaner::new(options, Role::Controller),
            node,
        })
    }

    /// The newest result; none if no motion has ended yet.
    ///
    /// # Errors
    /// [`ClientError::BadMessage`] or [`ClientError::Transport`].
    pub fn latest(&mut self) -> Result<Option<MotionResult>, ClientError> {
        take_in(&self.results, &mut self.recent)?;
        Ok(self.recent.back().copied())
    }

    /// Appends the results that have arrived and that no other call has taken in. Call it at least once in the time of sixteen motions; a
    /// number that is missing in their `sequence` is a result that was missed.
    ///
    /// # Errors
    /// [`ClientError::BadMessage`] or [`ClientError::Transport`].
    pub fn drain(&mut self, results: &mut Vec<MotionResult>) -> Result<(), ClientError> {
        self.cleaner.clean_if_due(&self.node);
        while let Some(result) = next(&self.results)? {
            keep(&mut self.recent, result);
            results.push(result);
        }
        Ok(())
    }

    /// Waits until a trajectory has ended, at most for `timeout`; none where it has not, or has before the last results. Call it at least
    /// once in the time of sixteen motions.
    ///
    /// # Errors
    /// [`ClientError::BadMessage`] or [`ClientError::Transport`].
    pub fn wait_for<'program>(
        &mut self,
        trajectory_id: u32,
        timeout: impl Into<TimeLimit<'program>>,
    ) -> Result<Option<MotionResult>, ClientError> {
        let pause = |left: Duration| thread::sleep(LOOK_INTERVAL.min(left));
        let (results, recent) = (&self.results, &mut self.recent);
        wait(
            &timeout.into(),
            &mut self.cleaner,
            &self.node,
            pause,
            || {
                take_in(results, recent)?;
                let mut ended = recent.iter().rev();
                Ok(ended
                    .find(|result| result.values.trajectory_id == trajectory_id)
                    .copied())
            },
        )
    }
}

/// Appends the results that have arrived.
fn take_in(
    results: &Subscriber<message::MotionResult>,
    recent: &mut VecDeque<MotionResult>,
) -> Result<(), ClientError> {
    while let Some(result) = next(results)? {
        keep(recent, result);
    }
    Ok(())
}

fn next(results: &Subscriber<message::MotionResult>) -> Result<Option<MotionResult>, ClientError> {
    let Some(sample) = receive(|| results.receive())? else {
        return Ok(None);
    };
    let copy = *sample;
    checked(CONTROLLER, MotionResult::try_from(&copy)).map(Some)
}

/// Appends a result, and lets go of the oldest where there are too many.
fn keep(recent: &mut VecDeque<MotionResult>, result: MotionResult) {
    if recent.len() == KEPT {
        recent.pop_front();
    }
    recent.push_back(result);
}
