//! While the robot moves and nothing is asked for, the last request that began in motion is planned over and over, for nobody, until its
//! fastest motion is known: the next request finds code, memory and processors as fast as in quick succession (decision 0032).

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use planning::{EarlySelection, Planner, Problem, Request, Sampler, Supervision, Told};

use super::planned::{PlanError, guarded};
use super::planning_worker::PlanningWorker;

/// Time from the end of a plan to the next one for nobody: the longer it is, the colder the next request finds the workers.
const INTERVAL: Duration = Duration::from_millis(20);
/// Longest time of a plan for nobody: the processors are for others, too.
const LONGEST: Duration = Duration::from_millis(5);

/// Plans for nobody, on the planner's workers, one at a time.
pub(super) struct IdleWarmUp {
    /// The last request to one goal that began in motion, without what it goes on from.
    last_in_motion: Option<(Arc<Problem>, Request)>,
    /// When the workers planned last for somebody.
    planned: Instant,
    running: Option<Arc<Run>>,
}

/// A plan for nobody.
#[derive(Default)]
struct Run {
    /// Set where a request needs the workers.
    interrupt: AtomicBool,
    /// When it ended, and whether it can be made again: not where the planner panicked.
    ended: Mutex<Option<(Instant, bool)>>,
}

impl Run {
    fn ended(&self) -> Option<(Instant, bool)> {
        *self.ended.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Plans until the fastest motion is known, it took too long, or it is interrupted.
    fn plan(&self, planner: &Planner, problem: &Problem, request: &Request) {
        let (begun, is_known) = (Instant::now(), AtomicBool::new(false));
        let interrupt = || {
            let is_needed = self.interrupt.load(Ordering::Relaxed);
            is_needed || is_known.load(Ordering::Relaxed) || begun.elapsed() > LONGEST
        };
        let early_selection = EarlySelection {
            begin: &|_, _| {},
            selected: &|_| {
                is_known.store(true, Ordering::Relaxed);
                Told::InTime
            },
        };
        let supervision = Supervision {
            early_selection: Some(early_selection),
            ..Supervision::new(&interrupt)
        };
        let planned = guarded(|| planner.plan_supervised(problem, request, supervision));
        let is_sound = !matches!(planned, Err(PlanError::Panic(_)));
        let mut ended = self.ended.lock().unwrap_or_else(PoisonError::into_inner);
        *ended = Some((Instant::now(), is_sound));
    }
}

impl IdleWarmUp {
    pub(super) fn new() -> Self {
        Self {
            last_in_motion: None,
            planned: Instant::now(),
            running: None,
        }
    }

    /// Leaves the workers to a request, which is planned again later where it is to one goal, in motion among obstacles that rest.
    pub(super) fn give_way(&mut self, problem: &Arc<Problem>, request: &Request, has_via: bool) {
        if let Some(run) = self.running.take() {
            run.interrupt.store(true, Ordering::Relaxed);
        }
        let tells_early = request.sampler == Sampler::Default && problem.moving.is_empty();
        if request.start_motion.is_some() && tells_early && !has_via {
            let request = Request {
                end_to_move: None,
                previous: None,
                ..request.clone()
            };
            self.last_in_motion = Some((Arc::clone(problem), request));
        }
        self.planned = Instant::now();
    }

    /// Has the worker plan for nobody where the last plan ended long enough ago; returns at once.
    pub(super) fn run_if_due(&mut self, now: Instant, worker: &PlanningWorker) {
        let before = self.running.as_ref().map(|run| run.ended());
        let rests_since = match before {
            None => self.planned,
            Some(None) => return,
            Some(Some((ended, true))) => ended.max(self.planned),
            Some(Some((_, false))) => {
                self.last_in_motion = None;
                return;
            }
        };
        let Some((problem, request)) = self.last_in_motion.clone() else {
            return;
        };
        if now.saturating_duration_since(rests_since) < INTERVAL {
            return;
        }
        let run = Arc::<Run>::default();
        self.running = Some(Arc::clone(&run));
        worker.run(move |planner| run.plan(planner, &problem, &request));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{request, straight_problem, unit_robot};
    use pcc_model::Configuration;
    use planning::{Models, PreviousPlan, StartMotion};
    use std::thread::sleep;

    fn worker() -> PlanningWorker {
        PlanningWorker::start(
            Planner::new(unit_robot(), Models::default(), 1).unwrap(),
            true,
        )
    }

    fn in_motion(sampler: Sampler) -> Request {
        Request {
            sampler,
            start_motion: Some(StartMotion {
                velocity: Configuration::repeat(0.01),
                acceleration: Configuration::zeros(),
            }),
            ..request()
        }
    }

    fn wait_for_end(run: &Run) -> (Instant, bool) {
        let begun = Instant::now();
        loop {
            if let Some(ended) = run.ended() {
                return ended;
            }
            assert!(begun.elapsed() < Duration::from_secs(60), "it does not end");
            sleep(Duration::from_millis(1));
        }
    }

    #[test]
    fn only_the_last_request_to_one_goal_in_motion_is_planned_for_nobody_and_only_after_a_rest() {
        let (mut idle, worker) = (IdleWarmUp::new(), worker());
        let problem = Arc::new(straight_problem());
        let later = |idle: &IdleWarmUp| idle.planned + INTERVAL;
        for (request, has_via) in [
            (request(), false),
            (in_motion(Sampler::Straight), false),
            (in_motion(Sampler::Default), true),
        ] {
            idle.give_way(&problem, &request, has_via);
            idle.run_if_due(later(&idle), &worker);
            assert!(idle.running.is_none());
        }
        let goes_on = Request {
            previous: Some(Arc::new(PreviousPlan {
                paths: Vec::new(),
                followed: None,
            })),
            ..in_motion(Sampler::Default)
        };
        idle.give_way(&problem, &goes_on, false);
        let (_, request) = idle.last_in_motion.as_ref().unwrap();
        assert!(request.previous.is_none());
        idle.run_if_due(idle.planned + INTERVAL / 2, &worker);
        assert!(idle.running.is_none(), "the workers have just planned");
        idle.run_if_due(later(&idle), &worker);
        let first = idle.running.clone().unwrap();
        let (ended, is_sound) = wait_for_end(&first);
        assert!(is_sound);
        idle.run_if_due(ended + INTERVAL / 2, &worker);
        assert!(Arc::ptr_eq(&first, idle.running.as_ref().unwrap()));
        idle.run_if_due(ended + INTERVAL, &worker);
        assert!(!Arc::ptr_eq(&first, idle.running.as_ref().unwrap()));
    }

    #[test]
    fn a_request_interrupts_it() {
        let (mut idle, worker) = (IdleWarmUp::new(), worker());
        let problem = Arc::new(straight_problem());
        idle.give_way(&problem, &in_motion(Sampler::Default), false);
        idle.run_if_due(idle.planned + INTERVAL, &worker);
        let run = idle.running.clone().unwrap();
        assert!(!run.interrupt.load(Ordering::Relaxed));
        idle.give_way(&problem, &request(), false);
        assert!(run.interrupt.load(Ordering::Relaxed));
        assert!(idle.running.is_none());
        wait_for_end(&run);
    }
}
