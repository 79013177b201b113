//! Which processor each of the planner's workers keeps to, where each has its own (decisions 0035 and 0045).

use std::collections::BTreeSet;
use std::sync::{Mutex, PoisonError};

use planning::Planner;
use realtime::RealtimeError;

/// A worker that keeps to a processor.
#[derive(Debug)]
struct PinnedWorker {
    thread: u32,
    processor: usize,
}

/// The workers, each with its processor.
#[derive(Debug)]
pub(super) struct WorkerProcessors(Vec<PinnedWorker>);

impl WorkerProcessors {
    /// None unless each worker has a processor of its own.
    pub(super) fn of(planner: &Planner) -> Option<Self> {
        let workers = Mutex::new(Vec::new());
        planner.on_every_worker(|_| {
            let worker = match realtime::allowed_processors().as_deref() {
                Ok([processor]) => Some(PinnedWorker {
                    thread: realtime::thread_id(),
                    processor: *processor,
                }),
                _ => None,
            };
            // Nothing panics while it is locked.
            let mut workers = workers.lock().unwrap_or_else(PoisonError::into_inner);
            workers.push(worker);
        });
        let workers = workers.into_inner().unwrap_or_else(PoisonError::into_inner);
        let workers: Vec<PinnedWorker> = workers.into_iter().collect::<Option<_>>()?;
        let processors: BTreeSet<usize> = workers.iter().map(|it| it.processor).collect();
        (processors.len() == workers.len()).then_some(Self(workers))
    }

    /// Gives a worker the processor of the calling thread, and the worker that has it the other one's.
    ///
    /// # Errors
    /// [`RealtimeError::Processors`]; both stay where they were then.
    pub(super) fn bring_to_current(&mut self, thread: u32) -> Result<(), RealtimeError> {
        let here = realtime::current_processor();
        let index_of = |is_it: &dyn Fn(&PinnedWorker) -> bool| self.0.iter().position(is_it);
        let brought = index_of(&|it| it.thread == thread);
        let leaving = index_of(&|it| it.processor == here);
        let (Some(brought), Some(leaving)) = (brought, leaving) else {
            return Ok(());
        };
        if brought == leaving {
            return Ok(());
        }
        let there = self.0[brought].processor;
        realtime::set_cpu_affinity_of(self.0[leaving].thread, &[there])?;
        if let Err(error) = realtime::set_cpu_affinity_of(thread, &[here]) {
            // It was allowed until now.
            let _ = realtime::set_cpu_affinity_of(self.0[leaving].thread, &[here]);
            return Err(error);
        }
        self.0[leaving].processor = there;
        self.0[brought].processor = here;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::unit_robot;
    use planning::Models;
    use std::thread;

    fn planner(workers: usize) -> Planner {
        Planner::new(unit_robot(), Models::default(), workers).unwrap()
    }

    #[test]
    fn a_worker_that_is_brought_exchanges_processors_with_the_one_that_is_here() {
        let allowed = realtime::allowed_processors().unwrap();
        let [first, .., last] = allowed[..] else {
            // There is one, which everybody shares.
            return;
        };
        let planner = planner(2);
        assert!(WorkerProcessors::of(&planner).is_none(), "they share all");
        planner.on_every_worker(|worker| {
            realtime::set_cpu_affinity(&[[first, last][worker]]).unwrap();
        });
        let mut workers = WorkerProcessors::of(&planner).unwrap();
        let worker_at = |workers: &WorkerProcessors, processor| {
            let mut of = workers.0.iter();
            of.find(|it| it.processor == processor).unwrap().thread
        };
        let (stays, other) = (worker_at(&workers, first), worker_at(&workers, last));
        // The thread of the test stays where it may run.
        let bringing = thread::spawn(move || {
            for here in [last, first, first] {
                realtime::set_cpu_affinity(&[here]).unwrap();
                workers.bring_to_current(stays).unwrap();
                assert_eq!(worker_at(&workers, here), stays);
            }
            realtime::set_cpu_affinity(&[last]).unwrap();
            workers.bring_to_current(stays).unwrap();
        });
        bringing.join().unwrap();
        let are_at = Mutex::new(Vec::new());
        planner.on_every_worker(|_| {
            let place = (
                realtime::thread_id(),
                realtime::allowed_processors().unwrap(),
            );
            are_at.lock().unwrap().push(place);
        });
        let mut are_at = are_at.into_inner().unwrap();
        are_at.sort_by_key(|(thread, _)| *thread != stays);
        assert_eq!(are_at, [(stays, vec![last]), (other, vec![first])]);
    }

    #[test]
    fn workers_that_cannot_exchange_processors_stay_where_they_are() {
        let here = realtime::allowed_processors().unwrap()[0];
        let planner = planner(2);
        let threads = Mutex::new(Vec::new());
        planner.on_every_worker(|_| {
            realtime::set_cpu_affinity(&[here]).unwrap();
            threads.lock().unwrap().push(realtime::thread_id());
        });
        let threads = threads.into_inner().unwrap();
        let processors = [usize::MAX, here];
        let workers = threads.iter().zip(processors);
        let workers = workers.map(|(&thread, processor)| PinnedWorker { thread, processor });
        let mut workers = WorkerProcessors(workers.collect());
        // The thread of the test stays where it may run.
        let refused = thread::spawn(move || {
            realtime::set_cpu_affinity(&[here]).unwrap();
            workers.bring_to_current(threads[0]).is_err() && workers.0[1].processor == here
        });
        assert!(refused.join().unwrap());
        planner.on_every_worker(|_| assert_eq!(realtime::allowed_processors().unwrap(), [here]));
    }
}
