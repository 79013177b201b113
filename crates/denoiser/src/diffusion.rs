//! Reverse diffusion of paths: noise schedule, DDIM and DPM-Solver++(2M), refinement in the last steps.

mod reverse_process;
mod schedule;

pub use reverse_process::{
    Denoiser, Held, Refinement, ReverseProcess, ReverseProcessScratch, Solver,
};
pub(crate) use schedule::STEPS;
