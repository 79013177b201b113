//! Attempts on all workers, of which the first in order that succeeds counts.

use crate::request::Interrupt;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// The result of the first successful one of the attempts 0 to `count` − 1; none if none succeeds, or if interrupted before one has.
///
/// Workers begin the attempts in their order. Each is handed an interrupt of its own, which is also true as soon as an attempt
/// of a smaller number has succeeded, so the answer does not depend on how many workers there are.
pub(crate) fn first_success<T: Send>(
    count: usize,
    interrupt: Interrupt,
    attempt: impl Fn(usize, Interrupt) -> Option<T> + Sync,
) -> Option<T> {
    let (begun, first) = (AtomicUsize::new(0), AtomicUsize::new(usize::MAX));
    let made = Mutex::new(None);
    let is_in_vain = |number| first.load(Ordering::Relaxed) < number || interrupt();
    let work = |_| {
        loop {
            let number = begun.fetch_add(1, Ordering::Relaxed);
            if number >= count || is_in_vain(number) {
                break;
            }
            let Some(success) = attempt(number, &|| is_in_vain(number)) else {
                continue;
            };
            let mut made = made.lock().unwrap_or_else(PoisonError::into_inner);
            if first.fetch_min(number, Ordering::Relaxed) > number {
                *made = Some(success);
            }
        }
    };
    let workers = (0..rayon::current_num_threads()).into_par_iter();
    workers.with_max_len(1).for_each(work);
    made.into_inner().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::thread::sleep;
    use std::time::{Duration, Instant};

    fn on(workers: usize, task: impl FnOnce() -> Option<usize> + Send) -> Option<usize> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(workers);
        pool.build().unwrap().install(task)
    }

    #[test]
    fn the_first_in_order_counts_however_long_it_takes() {
        for workers in [1, 2, 5] {
            let attempt = |number: usize, _: Interrupt| {
                sleep(Duration::from_millis(if number == 3 { 20 } else { 1 }));
                [3, 4, 7].contains(&number).then_some(number)
            };
            let never = || false;
            let made = on(workers, || first_success(10, &never, attempt));
            assert_eq!(made, Some(3), "{workers} workers");
            let none = on(workers, || first_success(3, &never, attempt));
            assert_eq!(none, None);
        }
    }

    #[test]
    fn what_comes_too_late_is_interrupted() {
        let attempt = |number: usize, is_in_vain: Interrupt| {
            let begun = Instant::now();
            while number > 0 && !is_in_vain() {
                assert!(begun.elapsed() < Duration::from_secs(60));
            }
            Some(number)
        };
        assert_eq!(on(3, || first_success(9, &|| false, attempt)), Some(0));
        assert_eq!(on(3, || first_success(9, &|| true, attempt)), None);
    }
}
