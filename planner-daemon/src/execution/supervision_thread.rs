//! The handle of the supervision thread.

use std::sync::Arc;
use std::sync::atomic::AtomicU64;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::time::Duration;

use shared_types::clock::mono_now_ns;
use shared_types::ipc::{IpcNode, IpcOptions, JoinOnDrop, spawn_with_ports};

use super::heartbeat::BackgroundError;
use super::refusal::ExecutionRefusal;
use super::request::{ExecutionRequest, ReplySlot, SelectedMotion};
use super::rules::ExecutionRules;
use super::supervisor::Supervisor;
use crate::live_scene::SceneMemory;

/// Time within which supervision must publish a motion; later it refuses it. Heartbeats stop sooner where supervision stalls.
const REPLY_TIMEOUT: Duration = Duration::from_millis(250);

/// The handle of the supervision thread, which publishes motions and supervises them. Dropping it stops what moves and joins the thread.
pub(crate) struct Execution {
    /// Supervision stops what moves, and ends, once this is dropped: declared before the thread, which is joined when it is dropped,
    /// because fields are dropped in the order of their declaration.
    to_supervision: SyncSender<ExecutionRequest>,
    _thread: JoinOnDrop,
}

impl Execution {
    /// Starts the thread, with a node of its own, at a real-time priority if there is one; `instance` is the daemon's in its heartbeat.
    pub(crate) fn start(
        options: &IpcOptions,
        rules: ExecutionRules,
        instance: u64,
        supervision_rounds: &Arc<AtomicU64>,
        realtime_priority: Option<u8>,
    ) -> Result<Self, BackgroundError> {
        let node = IpcNode::create(options, "planner-daemon supervision")?;
        let (to_supervision, requests) = sync_channel(1);
        let supervision_rounds = Arc::clone(supervision_rounds);
        let memory = SceneMemory::open(options)?;
        let open = move || {
            Supervisor::open(
                &node,
                memory,
                rules,
                instance,
                supervision_rounds,
                realtime_priority,
            )
        };
        let work = move |mut supervisor: Supervisor| supervisor.run(&requests);
        let thread = spawn_with_ports("supervision", open, work)??;
        Ok(Self {
            to_supervision,
            _thread: thread.into(),
        })
    }

    /// Has the supervision thread check a motion against the controller and the live scene, publish it and supervise it; returns its id.
    ///
    /// # Errors
    /// [`ExecutionRefusal`]: why it is not published.
    pub(crate) fn publish(&self, selected: SelectedMotion) -> Result<u32, ExecutionRefusal> {
        let (answer, answered) = sync_channel(1);
        let slot = Arc::<ReplySlot>::default();
        let requests = ExecutionRequest {
            selected,
            until_mono_ns: mono_now_ns() + REPLY_TIMEOUT.as_nanos() as i64,
            slot: Arc::clone(&slot),
            answer,
        };
        if self.to_supervision.try_send(requests).is_err() {
            return Err(ExecutionRefusal::SupervisionStalled);
        }
        let answered = answered.recv_timeout(2 * REPLY_TIMEOUT);
        answered.unwrap_or_else(|_| slot.abandon().ok_or(ExecutionRefusal::SupervisionStalled))
    }
}
