//! Runs the planner on its own workers, one request at a time, beside the service thread.
//!
//! The service thread keeps its ports and goes on receiving, refusing and answering meanwhile.

use std::io;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use pcc_model::UnitRobot;
use planning::{
    CanBegin, Candidate, EarlySelection, Planner, Problem, Request, Supervision, ToBeDone, Told,
    Via,
};

use super::idle_warm_up::IdleWarmUp;
use super::in_flight::ATTEMPTS;
use super::planned::{Planned, guarded};
use super::planner_kind::PlannerKind;
use super::planning_worker::PlanningWorker;
use super::stored_plan::StoredPlan;
use super::wait_mode::WaitMode;
use crate::execution::Switch;
use rustix::event::{EventfdFlags, eventfd};

/// Longest wait of a worker for what is done with a selected candidate.
const LONGEST_WAIT: Duration = Duration::from_millis(50);

/// A planning job: problem, request and deadline.
pub(crate) struct Job {
    pub(crate) problem: Arc<Problem>,
    /// Goals that the motion passes before the problem's own.
    pub(crate) via: Vec<Via>,
    pub(crate) request: Request,
    pub(crate) deadline: Instant,
    /// The early answer that is wanted, if any.
    pub(crate) early: Option<Early>,
    /// Where the motions are to begin, asked when they may begin too late; then the fastest candidate is an output of its own as soon as it is
    /// known.
    pub(crate) late_switch: Option<LateSwitch>,
    /// Set when the client has cancelled the request.
    pub(crate) cancelled: Arc<AtomicBool>,
}

/// Chooses where the motion that is followed is left, with what is still to be done; none where the switch that was chosen last is in time, the
/// motion cannot be left any more, or none can begin where it would be.
pub(crate) type LateSwitch = Box<dyn Fn(ToBeDone, &CanBegin) -> Option<Switch> + Send + Sync>;

/// Where candidates begin, as it was chosen while they were planned.
pub(crate) struct LateBegin {
    /// None: where the job says.
    pub(crate) switch: Option<Switch>,
    /// When it was chosen.
    pub(crate) chosen: Instant,
    /// What was to be done from then on until the fastest one is known.
    pub(crate) to_be_done: ToBeDone,
}

/// The early answer that a client asked for: its number of candidates, as soon as they are certified.
pub(crate) struct Early {
    /// Number of candidates.
    pub(crate) count: usize,
    /// Whether a candidate can be delivered.
    pub(crate) is_deliverable: Box<dyn Fn(&Candidate) -> bool + Send + Sync>,
}

/// Output of a job: early candidates, the late switch and the fastest candidate where they were asked for, then the plan.
pub(crate) enum PlanOutput {
    Early(Vec<Candidate>),
    /// Where all candidates begin.
    Begins(LateBegin),
    /// The fastest candidate; once more where it came too late.
    Selected(Candidate, InWork),
    Plan(Planned),
}

/// Held while a selected candidate is handled. The worker that has sent it sleeps until this is dropped, at most [`LONGEST_WAIT`].
pub(crate) struct InWork(SyncSender<Told>);

impl InWork {
    /// Tells the worker that its candidate came too late; returns whether it still waits for that.
    pub(crate) fn tell_too_late(&self) -> bool {
        self.0.try_send(Told::TooLate).is_ok()
    }
}

/// The planner with its output queue; it is idle or runs one job.
pub(crate) struct PlanRunner {
    robot: UnitRobot,
    worker: PlanningWorker,
    /// What answers in the planner's place, if anything does.
    stored: Option<StoredPlan>,
    idle: IdleWarmUp,
    outgoing: OutputSender,
    outputs: Receiver<PlanOutput>,
}

/// Sends outputs to the service thread and wakes it.
#[derive(Clone)]
struct OutputSender {
    outputs: SyncSender<PlanOutput>,
    /// An eventfd that is readable after an output was sent, until it is cleared.
    wake: Arc<OwnedFd>,
}

impl OutputSender {
    fn send(&self, output: PlanOutput) {
        // The receiver is gone when the daemon ends; a service that is not woken polls within a millisecond.
        let _ = self.outputs.send(output);
        let _ = rustix::io::write(&*self.wake, &1_u64.to_ne_bytes());
    }

    /// Sends the selected candidate, and waits until what is done with it is over.
    fn send_selected(&self, candidate: Candidate) -> Told {
        let (in_work, is_done) = sync_channel(1);
        self.send(PlanOutput::Selected(candidate, InWork(in_work)));
        is_done.recv_timeout(LONGEST_WAIT).unwrap_or(Told::InTime)
    }
}

/// So many at most, so that a worker never waits: its motion is told once an attempt, motions begin elsewhere once more than that, and there are its
/// early answer and its end.
const OUTPUTS_OF_A_JOB: usize = 2 * ATTEMPTS as usize + 3;

impl PlanRunner {
    /// `wait` is how the thread waits that hands jobs over.
    ///
    /// # Errors
    /// What the system says where there can be no more files.
    pub(crate) fn new(planner: Planner, kind: PlannerKind, wait: WaitMode) -> io::Result<Self> {
        let (outgoing, outputs) = sync_channel(OUTPUTS_OF_A_JOB);
        let wake = eventfd(0, EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK)?;
        let robot = planner.robot().clone();
        let worker = PlanningWorker::start(planner, wait == WaitMode::Event);
        Ok(Self {
            robot,
            idle: IdleWarmUp::new(),
            worker,
            stored: (kind == PlannerKind::Null).then(StoredPlan::default),
            outgoing: OutputSender {
                outputs: outgoing,
                wake: Arc::new(wake),
            },
            outputs,
        })
    }

    /// The robot in units of its section length.
    pub(crate) fn robot(&self) -> &UnitRobot {
        &self.robot
    }

    /// Hands over a job; its plan must be taken before the next one is handed over.
    pub(crate) fn begin(&mut self, job: Job) {
        let has_via = !job.via.is_empty();
        self.idle.give_way(&job.problem, &job.request, has_via);
        let (outgoing, stored) = (self.outgoing.clone(), self.stored.clone());
        // It may be readable for an output that was taken already.
        self.clear_wake();
        self.worker.run_here(move |planner| {
            let plan = || plan(planner, &job, &outgoing);
            let planned = match stored {
                Some(stored) => stored.get_or_store(&job.request, plan),
                None => plan(),
            };
            outgoing.send(PlanOutput::Plan(planned));
        });
    }

    /// Keeps the workers warm for the next job, while there is none.
    pub(crate) fn keep_warm(&mut self) {
        self.idle.run_if_due(Instant::now(), &self.worker);
    }

    /// The next output, if there is one; never waits.
    pub(crate) fn take(&self) -> Option<PlanOutput> {
        self.outputs.try_recv().ok()
    }

    /// A file descriptor to poll: readable when there may be an output.
    pub(crate) fn wake_fd(&self) -> BorrowedFd<'_> {
        self.outgoing.wake.as_fd()
    }

    /// Makes the wake descriptor unreadable until the next output; take the outputs that are there afterwards.
    pub(crate) fn clear_wake(&self) {
        let _ = rustix::io::read(&*self.outgoing.wake, &mut [0; 8]);
    }
}

fn plan(planner: &Planner, job: &Job, outgoing: &OutputSender) -> Planned {
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
                outgoing.send(PlanOutput::Early(collected.clone()));
            }
        }
    };
    let came_too_late = AtomicBool::new(false);
    let begin = |to_be_done: ToBeDone, can_begin: &CanBegin| {
        let chosen = Instant::now();
        let choose = job.late_switch.as_ref();
        let switch = choose.and_then(|choose| choose(to_be_done, can_begin));
        if switch.is_none() && came_too_late.load(Ordering::Relaxed) {
            // No motion of this plan can begin any more.
            job.cancelled.store(true, Ordering::Relaxed);
        }
        if switch.is_some() || !to_be_done.is_known() {
            outgoing.send(PlanOutput::Begins(LateBegin {
                switch,
                chosen,
                to_be_done,
            }));
        }
    };
    let early_selection = EarlySelection {
        begin: &begin,
        selected: &|candidate| {
            let told = outgoing.send_selected(candidate);
            came_too_late.store(told == Told::TooLate, Ordering::Relaxed);
            told
        },
    };
    let supervision = Supervision {
        interrupt: &interrupt,
        certified: job.early.is_some().then_some(&collect),
        early_selection: job.late_switch.is_some().then_some(early_selection),
    };
    guarded(|| planner.plan_route(&job.via, &job.problem, &job.request, supervision))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{request, straight_problem, unit_robot};
    use planning::Models;
    use rustix::event::{PollFd, PollFlags, Timespec};

    fn planning() -> PlanRunner {
        let planner = Planner::new(unit_robot(), Models::default(), 1).unwrap();
        PlanRunner::new(planner, PlannerKind::Pcc, WaitMode::Event).unwrap()
    }

    fn next(planning: &PlanRunner) -> PlanOutput {
        let begun = Instant::now();
        loop {
            if let Some(output) = planning.take() {
                return output;
            }
            let mut files = [PollFd::from_borrowed_fd(planning.wake_fd(), PollFlags::IN)];
            let limit = Timespec {
                tv_sec: 60,
                tv_nsec: 0,
            };
            rustix::event::poll(&mut files, Some(&limit)).unwrap();
            planning.clear_wake();
            assert!(begun.elapsed() < Duration::from_secs(60), "nothing came");
        }
    }

    fn job(deadline: Instant) -> Job {
        Job {
            problem: Arc::new(straight_problem()),
            via: Vec::new(),
            request: request(),
            deadline,
            early: None,
            late_switch: None,
            cancelled: Arc::default(),
        }
    }

    fn planned(planning: &PlanRunner) -> Planned {
        match next(planning) {
            PlanOutput::Plan(planned) => planned,
            _ => panic!("nothing early was asked for"),
        }
    }

    fn far() -> Instant {
        Instant::now() + Duration::from_secs(3600)
    }

    #[test]
    fn one_job_after_the_other_is_planned() {
        let mut planning = planning();
        assert!(planning.take().is_none());
        for _ in 0..2 {
            planning.begin(job(far()));
            let plan = planned(&planning).unwrap();
            assert!(!plan.truncated);
            assert!(!plan.candidates.is_empty());
        }
    }

    #[test]
    fn early_candidates_come_before_the_plan() {
        let mut planning = planning();
        let early = Some(Early {
            count: 1,
            is_deliverable: Box::new(|_| true),
        });
        planning.begin(Job {
            early,
            ..job(far())
        });
        match next(&planning) {
            PlanOutput::Early(candidates) => assert_eq!(candidates.len(), 1),
            _ => panic!("no early candidate came first"),
        }
        assert_eq!(planned(&planning).unwrap().candidates.len(), 1);
    }

    #[test]
    fn a_deadline_in_the_past_and_a_cancelled_job_truncate() {
        let mut planning = planning();
        planning.begin(job(Instant::now()));
        let plan = planned(&planning).unwrap();
        assert!(plan.truncated && plan.candidates.is_empty());
        let job = job(far());
        job.cancelled.store(true, Ordering::Relaxed);
        planning.begin(job);
        assert!(planned(&planning).unwrap().truncated);
    }
}
