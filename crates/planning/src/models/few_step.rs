//! Few-step sampling: residuals of paths from the learned flow.

use crate::path::sine_basis::UNKNOWNS;
use denoiser::{CandidateInput, FastModel, FastScratch};
use rand::{Rng, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use std::cell::RefCell;

thread_local! {
    /// Working memory of each worker, kept from request to request, so that only the first one allocates.
    static SCRATCH: RefCell<FastScratch> = RefCell::default();
}

/// How many of `candidates` are sampled together: equal parts for as many workers as pay off, each small enough that the interrupt is
/// asked often.
pub(crate) fn sampled_together(model: &FastModel, candidates: usize) -> usize {
    let few = model.worth_a_worker();
    let workers = rayon::current_num_threads().min(candidates / few);
    candidates.div_ceil(workers.max(1)).clamp(1, 2 * few)
}

/// Samples one residual (sine coefficients, term-major, radians, canonical frame) for each candidate, of which the first one has
/// the index `first` in its request.
///
/// The flow's noise is made `wideness` times as large: with 1 residuals are distributed as those that the model has learned.
///
/// A residual depends on its candidate, the seed, its index and the wideness alone, so neither threads nor neighbours matter.
pub(crate) fn sample_paths(
    model: &FastModel,
    candidates: &[CandidateInput],
    first: usize,
    seed: u64,
    wideness: f32,
) -> Vec<[f64; UNKNOWNS]> {
    let indices = first..first + candidates.len();
    let wide = |index| noise::<UNKNOWNS>(seed, index).map(|value| wideness * value);
    let noise: Vec<[f32; UNKNOWNS]> = indices.map(wide).collect();
    let mut out = vec![[0.0_f32; UNKNOWNS]; candidates.len()];
    SCRATCH.with_borrow_mut(|scratch| {
        model.sample(
            candidates,
            noise.as_flattened(),
            scratch,
            out.as_flattened_mut(),
        );
    });
    out.into_iter().map(|c| c.map(f64::from)).collect()
}

/// Noise of a candidate, from a generator whose seed is the draw of that index from the request's own.
pub(super) fn noise<const N: usize>(seed: u64, index: usize) -> [f32; N] {
    let mut seeds = Pcg64::seed_from_u64(seed);
    seeds.advance(index as u128);
    let mut rng = Pcg64::seed_from_u64(seeds.next_u64());
    std::array::from_fn(|_| StandardNormal.sample(&mut rng))
}
