//! iceoryx2 alone: a server that answers each request with the same knots, waits as the daemon does, and may hand each request over to a
//! thread and back as the daemon does.

use std::os::fd::{AsFd, OwnedFd};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{anyhow, ensure};
use realtime::{RealtimeError, hand_over};
use rustix::event::{EventfdFlags, eventfd};
use shared_types::capacity::MAX_KNOTS;
use shared_types::ipc::{
    EventListener, EventNotifier, IpcNode, IpcOptions, PlanActiveRequest, PlanClient,
    PlanServiceCapacity, event_listener, event_notifier, open_plan_service, plan_answered_event,
    plan_asked_event, plan_client, plan_server, plan_service,
};
use shared_types::message::{Knot, PlanReport, PlanRequest};

use super::checksum::checksum;

/// Longest sleeps of server and client, as the daemon's and its clients'.
const SERVER_SLEEP: Duration = Duration::from_millis(1);
const CLIENT_SLEEP: Duration = Duration::from_millis(2);

/// A thread that is handed each request, and says when it has had it. It comes to the processor of the thread that hands it over, as the daemon's
/// does where each planning thread has a processor.
struct Worker {
    thread: u32,
    /// Where it runs; none before its first job.
    processor: Option<usize>,
    jobs: hand_over::Sender<()>,
    done: Receiver<()>,
    /// Readable when one is done.
    wake: Arc<OwnedFd>,
}

impl Worker {
    fn start() -> anyhow::Result<Self> {
        let (jobs, to_do) = hand_over::channel::<()>();
        let (tell, done) = sync_channel(1);
        let (tell_thread, thread) = sync_channel(1);
        let wake = Arc::new(eventfd(0, EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK)?);
        let waking = Arc::clone(&wake);
        thread::spawn(move || {
            let _ = tell_thread.send(realtime::thread_id());
            for job in to_do {
                let _ = tell.send(job);
                let _ = rustix::io::write(&*waking, &1_u64.to_ne_bytes());
            }
        });
        Ok(Self {
            thread: thread.recv()?,
            processor: None,
            jobs,
            done,
            wake,
        })
    }

    fn hand_over(&mut self) -> Result<(), RealtimeError> {
        let here = realtime::current_processor();
        if self.processor != Some(here) {
            realtime::set_cpu_affinity_of(self.thread, &[here])?;
            self.processor = Some(here);
        }
        self.jobs.send(());
        Ok(())
    }

    fn is_done(&self) -> bool {
        let _ = rustix::io::read(&*self.wake, &mut [0; 8]);
        self.done.try_recv().is_ok()
    }
}

/// Answers each request with these knots until it is over.
pub(super) fn serve(
    options: &IpcOptions,
    knots: &[Knot],
    is_handed_over: bool,
    is_ready: impl FnOnce(),
    is_over: &AtomicBool,
) -> anyhow::Result<()> {
    let capacity = PlanServiceCapacity {
        clients: 1,
        active_requests_per_client: 1,
        candidates: knots.len().div_ceil(MAX_KNOTS),
        knots_per_candidate: MAX_KNOTS,
    };
    let node = IpcNode::create(options, "baseline-server")?;
    let service = plan_service(&node, &capacity)?;
    let server = plan_server(&node, &service, &capacity)?;
    let asked = event_listener(&node, &plan_asked_event(&node)?)?;
    let answered = event_notifier(&node, &plan_answered_event(&node)?)?;
    let mut worker = is_handed_over.then(Worker::start).transpose()?;
    let mut handed_over: Option<PlanActiveRequest> = None;
    is_ready();
    while !is_over.load(Ordering::Relaxed) {
        let received = server.receive().map_err(|error| anyhow!("{error:?}"))?;
        match (received, &mut worker) {
            (Some(request), None) => answer(&request, knots, &answered)?,
            (Some(request), Some(worker)) => {
                worker.hand_over()?;
                handed_over = Some(request);
            }
            (None, Some(worker)) if handed_over.is_some() => {
                if worker.is_done()
                    && let Some(request) = handed_over.take()
                {
                    answer(&request, knots, &answered)?;
                } else {
                    asked.wait(Some(worker.wake.as_fd()), SERVER_SLEEP)?;
                }
            }
            (None, _) => {
                asked.wait(None, SERVER_SLEEP)?;
            }
        }
    }
    Ok(())
}

fn answer(
    request: &PlanActiveRequest,
    knots: &[Knot],
    answered: &EventNotifier,
) -> anyhow::Result<()> {
    let response = request.loan_slice_uninit(knots.len());
    let response = response.map_err(|error| anyhow!("{error:?}"))?;
    let mut response = response.write_from_slice(knots);
    *response.user_header_mut() = PlanReport::ZEROED;
    response.send().map_err(|error| anyhow!("{error:?}"))?;
    answered.notify().map_err(|error| anyhow!("{error:?}"))?;
    Ok(())
}

/// The client's end.
pub(super) struct RawClient {
    client: PlanClient,
    asked: EventNotifier,
    answered: EventListener,
    // Declared last: the node outlives its ports.
    _node: IpcNode,
}

impl RawClient {
    pub(super) fn connect(options: &IpcOptions) -> anyhow::Result<Self> {
        let node = IpcNode::create(options, "baseline-client")?;
        let service = open_plan_service(&node)?;
        Ok(Self {
            client: plan_client(&node, &service)?,
            asked: event_notifier(&node, &plan_asked_event(&node)?)?,
            answered: event_listener(&node, &plan_answered_event(&node)?)?,
            _node: node,
        })
    }

    /// Asks, and reads the whole answer.
    pub(super) fn round_trip(&mut self, patience: Duration) -> anyhow::Result<u64> {
        let request = self.client.loan_uninit();
        let request = request.map_err(|error| anyhow!("{error:?}"))?;
        let pending = request.write_payload(PlanRequest::ZEROED).send();
        let pending = pending.map_err(|error| anyhow!("{error:?}"))?;
        self.asked.notify().map_err(|error| anyhow!("{error:?}"))?;
        let begun = Instant::now();
        loop {
            let received = pending.receive().map_err(|error| anyhow!("{error:?}"))?;
            if let Some(response) = received {
                return Ok(checksum(response.payload()));
            }
            ensure!(begun.elapsed() < patience, "no answer came");
            self.answered.wait(None, CLIENT_SLEEP)?;
        }
    }
}
