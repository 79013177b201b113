//! One of the planner's workers, which stays with the requests' tasks (decision 0045).

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::sync_channel;

use planning::Planner;
use realtime::hand_over::{self, Sender};

use super::worker_processors::WorkerProcessors;

type Task = Box<dyn FnOnce(&Planner) + Send>;

/// Runs tasks one after the other on one of the planner's workers, which ends with the planner once this is dropped and they are done.
///
/// It sleeps as soon as there is no task, whereas rayon's workers look for work for a while first; and the plan of a task begins on it.
pub(super) struct PlanningWorker {
    tasks: Sender<Task>,
    /// Tasks that are not done.
    undone: Arc<AtomicUsize>,
    thread: u32,
    /// Where it comes to who hands tasks over.
    processors: Option<WorkerProcessors>,
}

impl PlanningWorker {
    /// Takes the planner, and one of its workers; `comes` says whether that may come to the processor of the thread that hands tasks over: beside
    /// one that never sleeps there is no room.
    pub(super) fn start(planner: Planner, comes: bool) -> Self {
        let processors = comes.then(|| WorkerProcessors::of(&planner)).flatten();
        let undone = Arc::<AtomicUsize>::default();
        let (tasks, to_run) = hand_over::channel::<Task>();
        let (tell, told) = sync_channel(1);
        let planner = Arc::new(planner);
        let (shared, done) = (Arc::clone(&planner), Arc::clone(&undone));
        planner.spawn(move || {
            let _ = tell.send(realtime::thread_id());
            for task in to_run {
                task(&shared);
                done.fetch_sub(1, Ordering::Relaxed);
            }
        });
        let thread = told.recv().expect("the worker tells it at once");
        Self {
            tasks,
            undone,
            thread,
            processors,
        }
    }

    /// Runs a task after those that were given before; returns at once.
    pub(super) fn run(&self, task: impl FnOnce(&Planner) + Send + 'static) {
        self.undone.fetch_add(1, Ordering::Relaxed);
        self.tasks.send(Box::new(task));
    }

    /// The same of a task that somebody waits for: a worker that has none comes to the calling thread's processor, where workers have their own, so
    /// that no other one has to wake for what the two hand to each other.
    pub(super) fn run_here(&mut self, task: impl FnOnce(&Planner) + Send + 'static) {
        let is_idle = self.undone.load(Ordering::Relaxed) == 0;
        if is_idle
            && let Some(processors) = &mut self.processors
            && let Err(error) = processors.bring_to_current(self.thread)
        {
            tracing::warn!(
                "planning threads keep to their processors from now on, answers may be some 20 us late: {error}"
            );
            self.processors = None;
        }
        self.run(task);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::unit_robot;
    use planning::Models;
    use std::thread;

    #[test]
    fn tasks_run_in_their_order_on_one_thread_to_the_last() {
        let planner = Planner::new(unit_robot(), Models::default(), 2).unwrap();
        let worker = PlanningWorker::start(planner, true);
        let (tell, told) = sync_channel(8);
        for number in 0..8 {
            let tell = tell.clone();
            worker.run(move |_| tell.send((number, thread::current().id())).unwrap());
        }
        drop((worker, tell));
        // It ends with the last task, as its sender is gone then.
        let (numbers, threads): (Vec<_>, Vec<_>) = told.iter().unzip();
        assert!(numbers.into_iter().eq(0..8));
        assert!(threads.iter().all(|thread| *thread == threads[0]));
    }

    #[test]
    fn a_worker_comes_to_who_hands_it_tasks_where_it_may() {
        let allowed = realtime::allowed_processors().unwrap();
        let [first, .., last] = allowed[..] else {
            // There is one, which everybody shares.
            return;
        };
        for comes in [true, false] {
            let planner = Planner::new(unit_robot(), Models::default(), 2).unwrap();
            planner.on_every_worker(|worker| {
                realtime::set_cpu_affinity(&[[first, last][worker]]).unwrap();
            });
            let mut worker = PlanningWorker::start(planner, comes);
            // The thread of the test stays where it may run.
            let ran_at = thread::spawn(move || {
                [first, last, first].map(|here| {
                    realtime::set_cpu_affinity(&[here]).unwrap();
                    while worker.undone.load(Ordering::Relaxed) > 0 {
                        thread::yield_now();
                    }
                    let (tell, told) = sync_channel(1);
                    worker.run_here(move |_| tell.send(realtime::current_processor()).unwrap());
                    told.recv().unwrap()
                })
            });
            let ran_at = ran_at.join().unwrap();
            if comes {
                assert_eq!(ran_at, [first, last, first]);
            } else {
                assert!(ran_at.iter().all(|it| *it == ran_at[0]), "it stays");
            }
        }
    }
}
