//! Certificates and clearances allocate nothing, counted.
#![allow(clippy::unwrap_used)]
#![allow(unsafe_code, reason = "a counting allocator")]

mod motions;

use collision::{
    MovingBall, Scene, Solid, VoxelGrid, certify_edge, certify_moving, certify_polyline,
    certify_trajectory,
};
use motions::{ball, motion, random, scene, uneven_robot};
use nalgebra::Isometry3;
use pcc_model::Point;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::Arc;

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

/// A capsule, a box, a tetrahedron and a voxel, apart from each other.
fn solids() -> Vec<Arc<Solid>> {
    let at = |x: f64, y: f64, z: f64| Isometry3::translation(x, y, z);
    let tip = [Point::zeros(), Point::x(), Point::y(), Point::z()];
    let faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
    let voxel = VoxelGrid {
        counts: [1, 1, 1],
        cell: 0.3,
        filled: vec![true],
    };
    let solids = [
        Solid::capsule([Point::new(1.5, 0.0, 0.0), Point::new(1.5, 0.0, 2.0)], 0.1),
        Solid::cuboid(&Point::new(0.2, 0.3, 0.4), &at(-1.0, 1.0, 1.5)),
        Solid::mesh(&tip, &faces, &at(0.5, -1.5, 1.0)),
        Solid::voxels(voxel, &at(-1.0, -1.0, 2.0)),
    ];
    solids.map(|solid| Arc::new(solid.unwrap())).into()
}

#[test]
fn the_counter_counts() {
    assert_eq!(allocations_of(|| drop(std::hint::black_box(vec![1; 9]))), 1);
}

#[test]
fn certificates_and_clearances_allocate_nothing() {
    let (robot, mut random) = (uneven_robot(), random(1));
    for count in [1, 16, 17, 1000] {
        let balls = scene(&mut random, count, 0.0..0.05).balls().to_vec();
        let scene = Scene::with_solids(balls, solids()).unwrap();
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
                free |= certify_trajectory(&robot, &scene, &motion, 0.1).is_free();
                free |= certify_moving(&robot, &moving, &motion, [0.1, f64::INFINITY]).is_free();
                let clearance = scene.clearance(&robot.backbone(&a), &[0.1; 3]);
                std::hint::black_box((free, clearance));
            });
            assert_eq!(allocations, 0, "with {count} balls");
        }
    }
}
