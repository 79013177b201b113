//! Which processor each of the planner's workers keeps to, where each has its own (decisions 0035 and 0045).

use std::collections::BTreeSet;
use std::sync::{Mutex, PoisonError};

use planning::Planner;
use realtime::RealtimeError;

/// A worker and its processor.
#[derive(Debug)]
struct Place {
    thread: u32,
    processor: usize,
}

/// The workers' places.
#[derive(Debug)]
pub(super) struct WorkerPlaces(Vec<Place>);

impl WorkerPlaces {
    /// None unless each worker has a processor of its own.
    pub(super) fn of(planner: &Planner) -> Option<Self> {
        let places = Mutex::new(Vec::new());
        planner.on_every_worker(|_| {
            let place = match realtime::allowed_processors().as_deref() {
                Ok([processor]) => Some(Place {
                    thread: realtime::thread_id(),
                    processor: *processor,
                }),
                _ => None,
            };
            // Nothing panics while it is locked.
            let mut places = places.lock().unwrap_or_else(PoisonError::into_inner);
            places.push(place);
        });
        let places = places.into_inner().unwrap_or_else(PoisonError::into_inner);
        let places: Vec<Place> = places.into_iter().collect::<Option<_>>()?;
        let processors: BTreeSet<usize> = places.iter().map(|it| it.processor).collect();
        (processors.len() == places.len()).then_some(Self(places))
    }

    /// Gives a worker the processor of the calling thread, and the worker that has it the other one's.
    ///
    /// # Errors
    /// [`RealtimeError::Processors`].
    pub(super) fn bring_here(&mut self, worker: u32) -> Result<(), RealtimeError> {
        let here = realtime::current_processor();
        let index_of = |is_it: &dyn Fn(&Place) -> bool| self.0.iter().position(is_it);
        let brought = index_of(&|it| it.thread == worker);
        let leaving = index_of(&|it| it.processor == here);
        let (Some(brought), Some(leaving)) = (brought, leaving) else {
            return Ok(());
        };
        if brought == leaving {
            return Ok(());
        }
        let there = self.0[brought].processor;
        for (index, processor) in [(brought, here), (leaving, there)] {
            realtime::set_cpu_affinity_of(self.0[index].thread, &[processor])?;
            self.0[index].processor = processor;
        }
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
        assert!(WorkerPlaces::of(&planner).is_none(), "they share all");
        planner.on_every_worker(|worker| {
            realtime::set_cpu_affinity(&[[first, last][worker]]).unwrap();
        });
        let mut places = WorkerPlaces::of(&planner).unwrap();
        let worker_at = |places: &WorkerPlaces, processor| {
            let mut of = places.0.iter();
            of.find(|it| it.processor == processor).unwrap().thread
        };
        let (stays, other) = (worker_at(&places, first), worker_at(&places, last));
        // The thread of the test stays where it may run.
        let bringing = thread::spawn(move || {
            for here in [last, first, first] {
                realtime::set_cpu_affinity(&[here]).unwrap();
                places.bring_here(stays).unwrap();
                assert_eq!(worker_at(&places, here), stays);
            }
            realtime::set_cpu_affinity(&[last]).unwrap();
            places.bring_here(stays).unwrap();
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
}
