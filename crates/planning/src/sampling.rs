//! Drawing residuals from the learned sampler, in equal parts on every worker.

use crate::basis::UNKNOWNS;
use crate::features::Features;
use denoiser::{CandidateInput, FastModel, FastScratch};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use rayon::prelude::*;

/// Samples one residual (sine coefficients, term-major, radians, canonical frame) for each candidate.
///
/// The noise of a candidate depends on the seed and its index alone, so neither threads nor neighbours matter.
pub(crate) fn sample_paths(
    model: &FastModel,
    candidates: &[Features],
    seed: u64,
) -> Vec<[f64; UNKNOWNS]> {
    let share = candidates
        .len()
        .div_ceil(rayon::current_num_threads())
        .max(1);
    candidates
        .par_chunks(share)
        .enumerate()
        .flat_map_iter(|(part, chunk)| sample_chunk(model, chunk, part * share, seed))
        .collect()
}

fn sample_chunk(
    model: &FastModel,
    chunk: &[Features],
    first: usize,
    seed: u64,
) -> Vec<[f64; UNKNOWNS]> {
    let inputs: Vec<CandidateInput> = chunk
        .iter()
        .map(|f| CandidateInput {
            ends: &f.ends,
            balls: &f.balls,
        })
        .collect();
    let noise: Vec<f32> = (first..first + chunk.len())
        .flat_map(|index| noise(seed, index))
        .collect();
    let mut out = vec![0.0_f32; noise.len()];
    let mut scratch = FastScratch::default();
    let evaluations = model.evaluations();
    model.sample(&inputs, &noise, evaluations, &mut scratch, &mut out);
    out.chunks_exact(UNKNOWNS)
        .map(|c| std::array::from_fn(|i| f64::from(c[i])))
        .collect()
}

fn noise(seed: u64, index: usize) -> [f32; UNKNOWNS] {
    let mut rng = Pcg64::new(u128::from(seed), (index as u128) << 64);
    std::array::from_fn(|_| StandardNormal.sample(&mut rng))
}
