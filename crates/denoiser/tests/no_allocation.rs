//! Sampling allocates nothing once its buffers have grown.
#![allow(clippy::unwrap_used)]
#![allow(unsafe_code)] // a global allocator that counts

use denoiser::gemm::Precision;
use denoiser::{
    CandidateInput, FastModel, FastScratch, Manifest, TemporalUnet, UnetScratch, WarmStart,
};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::path::Path;

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

#[test]
fn sampling_allocates_only_in_the_first_call_of_a_size() {
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures");
    let file = Manifest::open(&fixtures).unwrap().weights("tiny").unwrap();
    let (ends, balls) = (vec![0.1; 36], vec![0.2; 28 * 5]);
    let candidate = CandidateInput {
        ends: &ends,
        balls: &balls,
        warm_start: None,
    };
    let warm_start = WarmStart {
        coefficients: &[0.1; 72],
        time: 0.7,
    };
    let mut candidates = [candidate; 10];
    candidates[2].warm_start = Some(warm_start);
    let (noise, mut out) = (vec![0.3; 720], vec![0.0; 720]);
    for precision in [Precision::F32, Precision::Bf16] {
        if !precision.available() {
            eprintln!("{precision:?} is not tried: this processor has no such products");
            continue;
        }
        let model = FastModel::from_weights(&file, std::f64::consts::FRAC_PI_2).unwrap();
        let model = model.with_precision(precision);
        let mut scratch = FastScratch::default();
        let mut count = |candidates: &[CandidateInput]| {
            let before = ALLOCATIONS.get();
            let length = 72 * candidates.len();
            let (noise, out) = (&noise[..length], &mut out[..length]);
            // so often that buffers made anew would need more than the memory that is asked for at a time
            for _ in 0..100 {
                model.sample(candidates, noise, &mut scratch, out);
            }
            ALLOCATIONS.get() - before
        };
        assert!(count(&candidates) > 0, "the counter counts");
        assert_eq!(count(&candidates), 0, "the same size again");
        assert_eq!(count(&candidates[..3]), 0, "fewer candidates");
        assert_eq!(count(&candidates), 0, "the first size again");
    }
}

#[test]
fn predicting_noise_and_its_gradient_allocates_only_in_the_first_call_of_a_size() {
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/unet");
    let file = Manifest::open(&fixtures).unwrap().weights("unet").unwrap();
    let unet = TemporalUnet::load(&file, std::f64::consts::FRAC_PI_2).unwrap();
    let condition = unet.condition(&[0.1; 6], &[0.2; 3], &[[0.3, 0.2, 0.1, 0.1]; 4]);
    let paths = vec![0.3; 5 * 384];
    let [mut noise, mut gradient] = [paths.clone(), paths.clone()];
    for precision in [Precision::F32, Precision::Bf16] {
        if !precision.available() {
            eprintln!("{precision:?} is not tried: this processor has no such products");
            continue;
        }
        unet.prepare_precision(precision);
        let mut scratch = UnetScratch::default();
        let mut count = |candidates: usize| {
            let before = ALLOCATIONS.get();
            let length = candidates * 384;
            let (paths, noise) = (&paths[..length], &mut noise[..length]);
            // so often that buffers made anew would need more than the memory that is asked for at a time
            for _ in 0..20 {
                unet.predict(&condition, 7.0, paths, precision, &mut scratch, noise);
                unet.pull_back(&mut scratch, paths, &mut gradient[..length]);
            }
            ALLOCATIONS.get() - before
        };
        assert!(count(5) > 0, "the counter counts");
        assert_eq!(count(5), 0, "the same size again");
        assert_eq!(count(2), 0, "fewer candidates");
        assert_eq!(count(5), 0, "the first size again");
    }
}
