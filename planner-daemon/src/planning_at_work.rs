//! Planning, away from the service: one request at a time, on the planner's own workers.
//!
//! The service's ports stay in its own thread, so it goes on receiving, refusing and supervising while a plan is made. A job
//! begins on a worker itself: no thread in between has to wake up.

use std::any::Any;
use std::io;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use planning::{Candidate, Plan, Planner, PlannerError, Problem, Request, Supervision};
use rustix::event::{EventfdFlags, eventfd};

/// What is to be planned, and until when.
pub(crate) struct Job {
    pub(crate) problem: Arc<Problem>,
    pub(crate) request: Request,
    pub(crate) deadline: Instant,
    /// What is wanted before the plan, if anything.
    pub(crate) early: Option<Early>,
    /// Set when nobody wants the answer any more.
    pub(crate) cancelled: Arc<AtomicBool>,
}

/// Some candidates that are wanted as soon as they certify.
pub(crate) struct Early {
    /// How many.
    pub(crate) count: usize,
    /// Whether one can be delivered.
    pub(crate) is_deliverable: Box<dyn Fn(&Candidate) -> bool + Send + Sync>,
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

/// The planner at work, idle or at one job.
pub(crate) struct Planning {
    planner: Arc<Planner>,
    outgoing: Outgoing,
    products: Receiver<Product>,
}

/// Where products go.
#[derive(Clone)]
struct Outgoing {
    products: SyncSender<Product>,
    /// Can be read when something was sent that was not looked for yet.
    told: Arc<OwnedFd>,
}

impl Outgoing {
    fn send(&self, product: Product) {
        // Nobody listens when the daemon ends; who is not told looks within a millisecond.
        let _ = self.products.send(product);
        let _ = rustix::io::write(&*self.told, &1_u64.to_ne_bytes());
    }
}

impl Planning {
    /// # Errors
    /// What the system says where there can be no more files.
    pub(crate) fn new(planner: Arc<Planner>) -> io::Result<Self> {
        // One early product and one plan: whoever plans never waits.
        let (outgoing, products) = sync_channel(2);
        let told = eventfd(0, EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK)?;
        Ok(Self {
            planner,
            outgoing: Outgoing {
                products: outgoing,
                told: Arc::new(told),
            },
            products,
        })
    }

    /// Hands over a job; its plan must be taken before the next one is handed over.
    pub(crate) fn begin(&self, job: Job) {
        let (planner, outgoing) = (Arc::clone(&self.planner), self.outgoing.clone());
        self.planner.spawn(move || {
            let planned = plan(&planner, &job, &outgoing);
            outgoing.send(Product::Plan(planned));
        });
    }

    /// What is there, if anything; never waits.
    pub(crate) fn take(&self) -> Option<Product> {
        self.products.try_recv().ok()
    }

    /// Can be read when there may be something to take, also when that was taken before.
    pub(crate) fn told(&self) -> BorrowedFd<'_> {
        self.outgoing.told.as_fd()
    }

    /// From now on only what is sent then can be read: whoever waited takes what is there next.
    pub(crate) fn has_heard(&self) {
        let _ = rustix::io::read(&*self.outgoing.told, &mut [0; 8]);
    }
}

fn plan(planner: &Planner, job: &Job, outgoing: &Outgoing) -> Planned {
    let interrupt = || job.cancelled.load(Ordering::Relaxed) || Instant::now() >= job.deadline;
    let collected: Mutex<Vec<Candidate>> = Mutex::default();
    let collect = |candidate: Candidate| {
        // A worker that panicked left whole candidates.
        let mut collected = collected.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(early) = &job.early else {
            return;
        };
        if (early.is_deliverable)(&candidate) {
            collected.push(candidate);
            if collected.len() == early.count {
                outgoing.send(Product::Early(collected.clone()));
            }
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
    use rustix::event::{PollFd, PollFlags, Timespec};
    use std::time::Duration;

    fn planning() -> Planning {
        let planner = Planner::new(&unit_robot(), Models::default(), 1).unwrap();
        Planning::new(Arc::new(planner)).unwrap()
    }

    fn next(planning: &Planning) -> Product {
        let begun = Instant::now();
        loop {
            if let Some(product) = planning.take() {
                return product;
            }
            let mut files = [PollFd::from_borrowed_fd(planning.told(), PollFlags::IN)];
            let limit = Timespec {
                tv_sec: 60,
                tv_nsec: 0,
            };
            rustix::event::poll(&mut files, Some(&limit)).unwrap();
            planning.has_heard();
            assert!(begun.elapsed() < Duration::from_secs(60), "nothing came");
        }
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

    fn planned(planning: &Planning) -> Planned {
        match next(planning) {
            Product::Plan(planned) => planned,
            Product::Early(_) => panic!("no early candidates were asked for"),
        }
    }

    fn far() -> Instant {
        Instant::now() + Duration::from_secs(3600)
    }

    #[test]
    fn one_job_after_the_other_is_planned() {
        let planning = planning();
        assert!(planning.take().is_none());
        for _ in 0..2 {
            planning.begin(job(far()));
            let plan = planned(&planning).unwrap();
            assert!(!plan.truncated);
            assert!(plan.selected.is_some());
        }
    }

    #[test]
    fn early_candidates_come_before_the_plan() {
        let planning = planning();
        let early = Some(Early {
            count: 1,
            is_deliverable: Box::new(|_| true),
        });
        planning.begin(Job {
            early,
            ..job(far())
        });
        match next(&planning) {
            Product::Early(candidates) => assert_eq!(candidates.len(), 1),
            Product::Plan(_) => panic!("no early candidate came first"),
        }
        assert_eq!(planned(&planning).unwrap().candidates.len(), 1);
    }

    #[test]
    fn a_deadline_in_the_past_and_a_cancelled_job_truncate() {
        let planning = planning();
        planning.begin(job(Instant::now()));
        let plan = planned(&planning).unwrap();
        assert!(plan.truncated && plan.candidates.is_empty());
        let job = job(far());
        job.cancelled.store(true, Ordering::Relaxed);
        planning.begin(job);
        assert!(planned(&planning).unwrap().truncated);
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
