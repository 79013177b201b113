//! While the robot moves and nothing is asked for, the last request that began in motion is planned over and over, for nobody, until its
//! fastest motion is known: the next request finds code, memory and processors as fast as in quick succession (decision 0032).

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use planning::{EarlySelection, Planner, Problem, Request, Supervision};

use super::planned::guarded;

/// Time from one rehearsal to the next: the longer it is, the colder the next request finds the workers.
const INTERVAL: Duration = Duration::from_millis(20);

/// Rehearses on the planner's workers, one plan at a time.
pub(super) struct Rehearsal {
    planner: Arc<Planner>,
    /// What is rehearsed: the last request to one goal that began in motion.
    part: Option<Part>,
    /// When the workers planned last, for whomever.
    planned: Instant,
    running: Option<Arc<Run>>,
}

#[derive(Clone)]
struct Part {
    problem: Arc<Problem>,
    request: Request,
}

/// A plan that is being rehearsed.
#[derive(Default)]
struct Run {
    /// Set where the fastest motion is known, or a request needs the workers.
    is_enough: AtomicBool,
    has_ended: AtomicBool,
}

impl Rehearsal {
    pub(super) fn new(planner: Arc<Planner>) -> Self {
        Self {
            planner,
            part: None,
            planned: Instant::now(),
            running: None,
        }
    }

    /// Leaves the workers to a request.
    pub(super) fn give_way(&mut self, problem: &Arc<Problem>, request: &Request) {
        if let Some(run) = self.running.take() {
            run.is_enough.store(true, Ordering::Relaxed);
        }
        if request.start_motion.is_some() && problem.moving.is_empty() {
            self.part = Some(Part {
                problem: Arc::clone(problem),
                request: request.clone(),
            });
        }
        self.planned = Instant::now();
    }

    /// Rehearses where the last plan was long enough ago; returns at once.
    pub(super) fn play(&mut self) {
        let is_running = |run: &Arc<Run>| !run.has_ended.load(Ordering::Relaxed);
        if self.planned.elapsed() < INTERVAL || self.running.as_ref().is_some_and(is_running) {
            return;
        }
        let Some(part) = self.part.clone() else {
            return;
        };
        self.planned = Instant::now();
        let (planner, run) = (Arc::clone(&self.planner), Arc::<Run>::default());
        self.running = Some(Arc::clone(&run));
        self.planner.spawn(move || {
            part.plan(&planner, &run.is_enough);
            run.has_ended.store(true, Ordering::Relaxed);
        });
    }
}

impl Part {
    /// Plans until the fastest motion is known; what comes of it is of no use.
    fn plan(&self, planner: &Planner, is_enough: &AtomicBool) {
        let early_selection = EarlySelection {
            begin: &|_, _| {},
            selected: &|_| is_enough.store(true, Ordering::Relaxed),
        };
        let interrupt = || is_enough.load(Ordering::Relaxed);
        let supervision = Supervision {
            early_selection: Some(early_selection),
            ..Supervision::new(&interrupt)
        };
        let _ = guarded(|| planner.plan_supervised(&self.problem, &self.request, supervision));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{request, straight_problem, unit_robot};
    use pcc_model::Configuration;
    use planning::{Models, StartMotion};
    use std::thread::sleep;

    fn rehearsal() -> Rehearsal {
        Rehearsal::new(Arc::new(
            Planner::new(unit_robot(), Models::default(), 1).unwrap(),
        ))
    }

    fn in_motion() -> Request {
        Request {
            start_motion: Some(StartMotion {
                velocity: Configuration::repeat(0.01),
                acceleration: Configuration::zeros(),
            }),
            ..request()
        }
    }

    #[test]
    fn the_last_request_in_motion_is_rehearsed_once_the_workers_have_rested() {
        let mut rehearsal = rehearsal();
        let problem = Arc::new(straight_problem());
        rehearsal.give_way(&problem, &request());
        sleep(INTERVAL);
        rehearsal.play();
        assert!(rehearsal.running.is_none(), "a request from rest");
        rehearsal.give_way(&problem, &in_motion());
        rehearsal.play();
        assert!(rehearsal.running.is_none(), "the workers have just planned");
        sleep(INTERVAL);
        rehearsal.play();
        let run = rehearsal.running.clone().unwrap();
        let begun = Instant::now();
        while !run.has_ended.load(Ordering::Relaxed) {
            assert!(begun.elapsed() < Duration::from_secs(60), "it does not end");
            sleep(Duration::from_millis(1));
        }
    }

    #[test]
    fn a_request_ends_the_rehearsal() {
        let mut rehearsal = rehearsal();
        let problem = Arc::new(straight_problem());
        rehearsal.give_way(&problem, &in_motion());
        sleep(INTERVAL);
        rehearsal.play();
        let run = rehearsal.running.clone().unwrap();
        rehearsal.give_way(&problem, &request());
        assert!(run.is_enough.load(Ordering::Relaxed));
        assert!(rehearsal.running.is_none());
    }
}
