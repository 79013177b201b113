//! Reverse diffusion of paths: noise schedule, DDIM and DPM-Solver++(2M), refinement in the last steps.

mod sampler;
mod schedule;

pub use sampler::{Denoiser, Held, Refinement, Sampler, SamplerScratch, Solver, UnknownSolver};
pub(crate) use schedule::STEPS;
