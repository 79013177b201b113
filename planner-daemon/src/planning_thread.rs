//! Planning, away from the service: one request at a time, on the planner's own workers.
//!
//! The service's ports stay in its own thread, so it goes on receiving, refusing and supervising while a plan is made.

use std::any::Any;
use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TryRecvError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{Builder, JoinHandle};
use std::time::{Duration, Instant};

use planning::{Candidate, Plan, Planner, PlannerError, Problem, Request, Supervision};

/// What is to be planned, and until when.
pub(crate) struct Job {
    pub(crate) problem: Arc<Problem>,
    pub(crate) request: Request,
    pub(crate) deadline: Instant,
    /// Certified candidates that are wanted before the plan, if any.
    pub(crate) early: Option<usize>,
    /// Set when nobody wants the answer any more.
    pub(crate) cancelled: Arc<AtomicBool>,
}

/// Why there is no plan.
#[derive(Debug, thiserror::Error)]
pub(crate) enum PlanFault {
    /// The planner says why.
    #[error(transparent)]
    Planner(#[from] PlannerError),
    /// A defect of the planner; the daemon goes on.
    #[error("internal error of the planner: {0}")]
    Panic(String),
}

pub(crate) type Planned = Result<Plan, PlanFault>;

/// What comes of a job: perhaps some candidates first, then the plan.
pub(crate) enum Product {
    Early(Vec<Candidate>),
    Plan(Planned),
}

/// The thread that plans, idle or at one job.
pub(crate) struct PlanningThread {
    jobs: Option<SyncSender<Job>>,
    products: Receiver<Product>,
    thread: Option<JoinHandle<()>>,
}

impl PlanningThread {
    /// Starts the thread.
    pub(crate) fn start(planner: Arc<Planner>) -> io::Result<Self> {
        let (jobs, incoming) = sync_channel::<Job>(1);
        let (outgoing, products) = sync_channel(2);
        let work = move || {
            while let Ok(job) = incoming.recv() {
                let planned = plan(&planner, &job, &outgoing);
                if outgoing.send(Product::Plan(planned)).is_err() {
                    break;
                }
            }
        };
        let thread = Builder::new().name("planning".to_owned()).spawn(work)?;
        Ok(Self {
            jobs: Some(jobs),
            products,
            thread: Some(thread),
        })
    }

    /// Hands over a job; its plan must be taken before the next one is handed over.
    pub(crate) fn begin(&self, job: Job) {
        let sent = self.jobs.as_ref().map(|jobs| jobs.send(job).is_ok());
        assert_eq!(sent, Some(true), "the thread lives as long as this handle");
    }

    /// What comes next, if it comes within `timeout`; a timeout of zero never waits.
    pub(crate) fn wait(&self, timeout: Duration) -> Option<Product> {
        if timeout.is_zero() {
            return match self.products.try_recv() {
                Ok(product) => Some(product),
                Err(TryRecvError::Empty) => None,
                Err(TryRecvError::Disconnected) => Some(thread_is_gone()),
            };
        }
        match self.products.recv_timeout(timeout) {
            Ok(product) => Some(product),
            Err(RecvTimeoutError::Timeout) => None,
            Err(RecvTimeoutError::Disconnected) => Some(thread_is_gone()),
        }
    }
}

impl Drop for PlanningThread {
    fn drop(&mut self) {
        self.jobs = None;
        if let Some(thread) = self.thread.take() {
            // What it was doing is caught and reported with its plan.
            let _ = thread.join();
        }
    }
}

fn thread_is_gone() -> Product {
    let fault = PlanFault::Panic("the planning thread ended".to_owned());
    Product::Plan(Err(fault))
}

fn plan(planner: &Planner, job: &Job, outgoing: &SyncSender<Product>) -> Planned {
    let interrupt = || job.cancelled.load(Ordering::Relaxed) || Instant::now() >= job.deadline;
    let collected = Mutex::new(Vec::new());
    let collect = |candidate| {
        // A worker that panicked left whole candidates.
        let mut early = collected.lock().unwrap_or_else(PoisonError::into_inner);
        early.push(candidate);
        if Some(early.len()) == job.early {
            // Nobody listens when the daemon ends.
            let _ = outgoing.send(Product::Early(early.clone()));
        }
    };
    let supervision = Supervision {
        interrupt: &interrupt,
        certified: job.early.is_some().then_some(&collect),
    };
    guarded(|| planner.plan_supervised(&job.problem, &job.request, supervision))
}

/// Runs a planner; a panic in it is an answer like any other.
fn guarded(plan: impl FnOnce() -> Result<Plan, PlannerError>) -> Planned {
    match catch_unwind(AssertUnwindSafe(plan)) {
        Ok(result) => Ok(result?),
        Err(payload) => Err(PlanFault::Panic(panic_text(payload.as_ref()))),
    }
}

fn panic_text(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<&str>().map(ToString::to_string);
    text.or_else(|| payload.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "panic without text".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{request, straight_problem, unit_robot};
    use planning::Models;

    fn thread() -> PlanningThread {
        let planner = Planner::new(&unit_robot(), Models::default(), 1).unwrap();
        PlanningThread::start(Arc::new(planner)).unwrap()
    }

    fn job(deadline: Instant) -> Job {
        Job {
            problem: Arc::new(straight_problem()),
            request: request(),
            deadline,
            early: None,
            cancelled: Arc::default(),
        }
    }

    fn planned(thread: &PlanningThread) -> Planned {
        match thread.wait(Duration::from_secs(60)) {
            Some(Product::Plan(planned)) => planned,
            Some(Product::Early(_)) => panic!("no early candidates were asked for"),
            None => panic!("nothing came in a minute"),
        }
    }

    fn far() -> Instant {
        Instant::now() + Duration::from_secs(3600)
    }

    #[test]
    fn one_job_after_the_other_is_planned() {
        let thread = thread();
        assert!(thread.wait(Duration::ZERO).is_none());
        for _ in 0..2 {
            thread.begin(job(far()));
            let plan = planned(&thread).unwrap();
            assert!(!plan.truncated);
            assert!(plan.selected.is_some());
        }
    }

    #[test]
    fn early_candidates_come_before_the_plan() {
        let thread = thread();
        let early = Some(1);
        thread.begin(Job {
            early,
            ..job(far())
        });
        match thread.wait(Duration::from_secs(60)) {
            Some(Product::Early(candidates)) => assert_eq!(candidates.len(), 1),
            _ => panic!("no early candidate came first"),
        }
        assert_eq!(planned(&thread).unwrap().candidates.len(), 1);
    }

    #[test]
    fn a_deadline_in_the_past_and_a_cancelled_job_truncate() {
        let thread = thread();
        thread.begin(job(Instant::now()));
        let plan = planned(&thread).unwrap();
        assert!(plan.truncated && plan.candidates.is_empty());
        let job = job(far());
        job.cancelled.store(true, Ordering::Relaxed);
        thread.begin(job);
        assert!(planned(&thread).unwrap().truncated);
    }

    #[test]
    fn a_panic_is_an_answer() {
        for payload in ["a defect".to_owned(), format!("{}", 7)] {
            let text = payload.clone();
            let fault = guarded(|| std::panic::panic_any(payload)).unwrap_err();
            assert!(fault.to_string().contains(&text), "{fault}");
        }
        let fault = guarded(|| panic!("static")).unwrap_err();
        assert!(fault.to_string().contains("static"), "{fault}");
    }
}
