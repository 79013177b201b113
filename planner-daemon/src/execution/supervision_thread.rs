//! The way to the thread that publishes motions and watches end_reason them.

use std::io;
use std::sync::Arc;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::{Builder, JoinHandle};
use std::time::Duration;

use shared_types::clock::mono_now_ns;
use shared_types::ipc::{IpcNode, IpcOptions};

use super::heartbeat::{BackgroundError, ProgressCounter};
use super::refusal::ExecutionRefusal;
use super::request::{ExecutionRequest, ReplySlot, SelectedMotion};
use super::rules::ExecutionRules;
use super::supervisor::Supervisor;
use crate::live_scene::SceneMemory;

/// Time within which supervision takes a motion up, or not at all: the heart stops sooner where it does not go on.
const REPLY_TIMEOUT: Duration = Duration::from_millis(250);

/// The way to the thread that publishes motions and watches end_reason them; ends it when dropped, once nothing moves.
pub(crate) struct Execution {
    to_supervision: Option<SyncSender<ExecutionRequest>>,
    thread: Option<JoinHandle<()>>,
}

impl Execution {
    /// Starts the thread, with a node of its own, at a real-time priority if there is one; `instance` is the daemon's in its heartbeat.
    pub(crate) fn start(
        options: &IpcOptions,
        rules: ExecutionRules,
        instance: u64,
        progress: &Arc<ProgressCounter>,
        realtime_priority: Option<u8>,
    ) -> Result<Self, BackgroundError> {
        let node = IpcNode::create(options, "planner-daemon supervision")?;
        let (to_supervision, requests) = sync_channel(1);
        let progress = Arc::clone(progress);
        let (tell, told) = sync_channel(1);
        let memory = SceneMemory::open(options)?;
        let supervise = move || {
            let opened =
                Supervisor::open(&node, memory, rules, instance, progress, realtime_priority);
            match opened {
                Ok(mut supervisor) => {
                    let _ = tell.send(Ok(()));
                    supervisor.run(&requests);
                }
                Err(error) => {
                    let _ = tell.send(Err(error));
                }
            }
        };
        let builder = Builder::new().name("supervision".to_owned());
        let thread = builder.spawn(supervise)?;
        told.recv().map_err(io::Error::other)??;
        Ok(Self {
            to_supervision: Some(to_supervision),
            thread: Some(thread),
        })
    }

    /// Has a motion checked against the controller and the live scene and published, by the thread that watches end_reason it from then on;
    /// returns its id.
    pub(crate) fn publish(&self, selected: SelectedMotion) -> Result<u32, ExecutionRefusal> {
        let (answer, answered) = sync_channel(1);
        let slot = Arc::<ReplySlot>::default();
        let requests = ExecutionRequest {
            selected,
            until_mono_ns: mono_now_ns() + REPLY_TIMEOUT.as_nanos() as i64,
            slot: Arc::clone(&slot),
            answer,
        };
        let ways = self.to_supervision.as_ref();
        if ways.is_none_or(|way| way.try_send(requests).is_err()) {
            return Err(ExecutionRefusal::SupervisionStalled);
        }
        let answered = answered.recv_timeout(2 * REPLY_TIMEOUT);
        answered.unwrap_or_else(|_| slot.abandon().ok_or(ExecutionRefusal::SupervisionStalled))
    }
}

impl Drop for Execution {
    /// Supervision stops what moves before it ends.
    fn drop(&mut self) {
        self.to_supervision = None;
        if let Some(thread) = self.thread.take() {
            // A thread that panicked has said so already.
            let _ = thread.join();
        }
    }
}
