//! One of the planner's workers, which stays with the requests' tasks (decision 0045).

use std::sync::Arc;
use std::sync::mpsc::sync_channel;

use planning::Planner;
use realtime::RealtimeError;
use realtime::hand_over::{self, Sender};

type Task = Box<dyn FnOnce(&Planner) + Send>;

/// Runs tasks one after the other on one of the planner's workers, which ends with the planner once this is dropped and they are done.
///
/// It sleeps as soon as there is no task, whereas rayon's workers look for work for a while first; and the plan of a task begins on it.
pub(super) struct PlanningWorker {
    tasks: Sender<Task>,
}

impl PlanningWorker {
    /// Takes the planner, and one of its workers.
    pub(super) fn start(planner: Planner) -> Self {
        let (tasks, to_run) = hand_over::channel::<Task>();
        let planner = Arc::new(planner);
        let shared = Arc::clone(&planner);
        planner.spawn(move || {
            for task in to_run {
                task(&shared);
            }
        });
        Self { tasks }
    }

    /// Keeps the calling thread to the worker's processors: where those are one, no other one has to wake for what the two hand to each other.
    ///
    /// # Errors
    /// [`RealtimeError::Processors`], also where the worker cannot tell its own (none are named then).
    pub(super) fn share_processors(&self) -> Result<(), RealtimeError> {
        let (tell, told) = sync_channel(1);
        self.run(move |_| {
            let _ = tell.send(realtime::allowed_processors());
        });
        match told.recv() {
            Ok(Ok(processors)) => realtime::set_cpu_affinity(&processors),
            Ok(Err(error)) => Err(RealtimeError::Processors {
                processors: Vec::new(),
                error,
            }),
            // The worker panicked, which ends the process.
            Err(_) => Ok(()),
        }
    }

    /// Runs a task after those that were given before; returns at once.
    pub(super) fn run(&self, task: impl FnOnce(&Planner) + Send + 'static) {
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
        let worker = PlanningWorker::start(planner);
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
    fn who_shares_its_processors_keeps_to_the_worker_s() {
        let allowed = realtime::allowed_processors().unwrap();
        let [_, .., last] = allowed[..] else {
            // There is one, which everybody shares.
            return;
        };
        let planner = Planner::new(unit_robot(), Models::default(), 1).unwrap();
        planner.on_every_worker(|_| realtime::set_cpu_affinity(&[last]).unwrap());
        let worker = PlanningWorker::start(planner);
        // The thread of the test stays where it may run.
        let sharing = thread::spawn(move || {
            worker.share_processors().unwrap();
            realtime::allowed_processors().unwrap()
        });
        assert_eq!(sharing.join().unwrap(), [last]);
    }
}
