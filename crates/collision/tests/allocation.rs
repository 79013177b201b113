//! Certificates and clearances allocate nothing, counted.
#![allow(clippy::unwrap_used)]
#![allow(unsafe_code, reason = "a counting allocator")]

mod motions;

use collision::{MovingBall, certify_edge, certify_moving, certify_polyline, certify_trajectory};
use motions::{ball, motion, random, scene, uneven_robot};
use pcc_model::Point;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

thread_local! {
    static ALLOCATIONS: Cell<usize> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: every call is passed on unchanged to the system's allocator, which keeps the contract; the counter is a
// constant-initialised thread-local without a destructor, so touching it allocates nothing.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        // SAFETY: the caller's promises are those that the system's allocator asks for.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        // SAFETY: as above; the block comes from the system's allocator.
        unsafe { System.dealloc(block, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn allocations_of(work: impl FnOnce()) -> usize {
    let before = ALLOCATIONS.get();
    work();
    ALLOCATIONS.get() - before
}

#[test]
fn the_counter_counts() {
    assert_eq!(allocations_of(|| drop(std::hint::black_box(vec![1; 9]))), 1);
}

#[test]
fn certificates_and_clearances_allocate_nothing() {
    let (robot, mut random) = (uneven_robot(), random(1));
    for count in [1, 16, 17, 1000] {
        let scene = scene(&mut random, count, 0.0..0.05);
        for _ in 0..20 {
            let motion = motion(&mut random);
            let points = motion.sample(64);
            let moving: Vec<MovingBall> = (0..count.min(40))
                .map(|_| MovingBall {
                    ball: ball(&mut random, 0.0..0.05),
                    velocity: Point::x() * 0.1,
                })
                .collect();
            let allocations = allocations_of(|| {
                let [a, b] = [points[0], points[63]];
                let mut free = certify_edge(&robot, &scene, &a, &b, 10).is_free();
                free |= certify_polyline(&robot, &scene, &points).is_free();
                free |= certify_trajectory(&robot, &scene, &motion, 0.1, 0.01).is_free();
                free |= certify_moving(&robot, &moving, &motion, 0.1, 0.01).is_free();
                let clearance = scene.clearance(&robot.backbone(&a), 0.1);
                std::hint::black_box((free, clearance));
            });
            assert_eq!(allocations, 0, "with {count} balls");
        }
    }
}
