//! One of the planner's workers, which stays with the requests' tasks (decision 0045).

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::sync_channel;

use planning::Planner;
use realtime::hand_over::{self, Sender};

use super::worker_places::WorkerPlaces;

type Task = Box<dyn FnOnce(&Planner) + Send>;

/// Runs tasks one after the other on one of the planner's workers, which ends with the planner once this is dropped and they are done.
///
/// It sleeps as soon as there is no task, whereas rayon's workers look for work for a while first; and the plan of a task begins on it.
pub(super) struct PlanningWorker {
    tasks: Sender<Task>,
    /// Tasks that are not done.
    undone: Arc<AtomicUsize>,
    thread: u32,
    places: Option<WorkerPlaces>,
}

impl PlanningWorker {
    /// Takes the planner, and one of its workers.
    pub(super) fn start(planner: Planner) -> Self {
        let places = WorkerPlaces::of(&planner);
        let undone = Arc::<AtomicUsize>::default();
        let (tasks, to_run) = hand_over::channel::<Task>();
        let (tell, told) = sync_channel(1);
        let planner = Arc::new(planner);
        let (shared, done) = (Arc::clone(&planner), Arc::clone(&undone));
        planner.spawn(move || {
            let _ = tell.send(realtime::thread_id());
            for task in to_run {
                task(&shared);
                done.fetch_sub(1, Ordering::Release);
            }
        });
        let thread = told.recv().expect("the worker tells it at once");
        Self {
            tasks,
            undone,
            thread,
            places,
        }
    }

    /// Lets the worker stay where it is, and not come to the thread that hands tasks over: one that never sleeps leaves no room beside it.
    pub(super) fn keep_away(&mut self) {
        self.places = None;
    }

    /// Runs a task after those that were given before; returns at once. A worker that sleeps comes to the calling thread's processor, where
    /// workers have their own: no other one has to wake for what the two hand to each other.
    pub(super) fn run(&mut self, task: impl FnOnce(&Planner) + Send + 'static) {
        let was_asleep = self.undone.fetch_add(1, Ordering::Acquire) == 0;
        if was_asleep
            && let Some(places) = &mut self.places
            && let Err(error) = places.bring_here(self.thread)
        {
            tracing::warn!("answers may be some 20 us late: {error}");
            self.places = None;
        }
        self.tasks.send(Box::new(task));
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
        let mut worker = PlanningWorker::start(planner);
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
    fn a_worker_comes_to_who_hands_it_tasks_unless_it_is_kept_away() {
        let allowed = realtime::allowed_processors().unwrap();
        let [first, .., last] = allowed[..] else {
            // There is one, which everybody shares.
            return;
        };
        let run_at = |worker: &mut PlanningWorker| {
            while worker.undone.load(Ordering::Relaxed) > 0 {
                thread::yield_now();
            }
            let (tell, told) = sync_channel(1);
            worker.run(move |_| tell.send(realtime::current_processor()).unwrap());
            told.recv().unwrap()
        };
        let planner = Planner::new(unit_robot(), Models::default(), 2).unwrap();
        planner.on_every_worker(|worker| {
            realtime::set_cpu_affinity(&[[first, last][worker]]).unwrap();
        });
        let mut worker = PlanningWorker::start(planner);
        // The thread of the test stays where it may run.
        let handing_over = thread::spawn(move || {
            for here in [first, last, first] {
                realtime::set_cpu_affinity(&[here]).unwrap();
                assert_eq!(run_at(&mut worker), here);
            }
            worker.keep_away();
            realtime::set_cpu_affinity(&[last]).unwrap();
            assert_eq!(run_at(&mut worker), first);
        });
        handing_over.join().unwrap();
    }
}
