//! Workers that stay awake while a request is planned.
//!
//! A worker without work goes to sleep, and waking it takes some 50 µs: as long as a whole stage. While a request goes
//! from stage to stage the others look for work all the time instead.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

/// Workers that are kept awake at most: stages of ten candidates have work for few.
const MOST: usize = 3;

/// Keeps other workers of the current pool awake until it is dropped.
pub(crate) struct Awake {
    done: Arc<AtomicBool>,
}

impl Awake {
    pub(crate) fn keep() -> Self {
        let done = Arc::new(AtomicBool::new(false));
        let others = rayon::current_num_threads().saturating_sub(1).min(MOST);
        for _ in 0..others {
            let done = Arc::clone(&done);
            rayon::spawn(move || look_for_work(&done));
        }
        Self { done }
    }
}

impl Drop for Awake {
    fn drop(&mut self) {
        self.done.store(true, Ordering::Relaxed);
    }
}

fn look_for_work(done: &AtomicBool) {
    while !done.load(Ordering::Relaxed) {
        if rayon::yield_now() != Some(rayon::Yield::Executed) {
            thread::yield_now();
        }
    }
}
