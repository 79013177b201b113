//! A time parameterizer that is kept allocates only its results, once its buffers have grown.
#![allow(clippy::unwrap_used)]
#![allow(unsafe_code)] // a global allocator that counts

use pcc_model::{Configuration, Robot};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::path::Path;
use trajectory::{ParameterizationOptions, TimeParameterizer};

thread_local! {
    /// Of this thread, whose test counts them.
    static ALLOCATIONS: Cell<usize> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: every call is handed to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        // SAFETY: the caller keeps GlobalAlloc's contract.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller keeps GlobalAlloc's contract.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// 64 points of a wave whose size and frequency depend on `index`.
fn path(index: usize) -> Vec<Configuration> {
    let (size, frequency) = (0.3 + 0.02 * index as f64, 1.0 + 0.3 * index as f64);
    let point = |u: f64| Configuration::from_fn(|row, _| size * (frequency * u + row as f64).sin());
    (0..64).map(|i| point(f64::from(i) / 63.0)).collect()
}

#[test]
fn a_warm_time_parameterizer_allocates_its_results_alone() {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../config/robots/unit.toml");
    let robot = Robot::from_file(Path::new(file)).unwrap();
    let paths: Vec<_> = (0..20).map(path).collect();
    let options = ParameterizationOptions::default();
    let mut parameterizer = TimeParameterizer::default();
    let mut results = Vec::with_capacity(2 * paths.len());
    let mut count = |paths: &[Vec<Configuration>]| {
        let before = ALLOCATIONS.get();
        for path in paths {
            let limits = &robot.tendon_limits;
            let motion = parameterizer.parameterize(path, &robot.tendons, limits, &options);
            results.push(motion.unwrap());
        }
        ALLOCATIONS.get() - before
    };
    assert!(count(&paths) > paths.len(), "the counter counts");
    assert_eq!(count(&paths), paths.len(), "one each: its knots");
}
