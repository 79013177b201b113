//! Learned samplers: weights files and their manifest, and the few-step path sampler. f32 slices in and out.
//!
//! This crate knows no robot and no processes: what the numbers mean is its caller's business.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod activation;
mod conv;
mod diffusion;
mod factors;
mod fast_model;
mod group_norm;
mod linear;
mod manifest;
mod manifest_entry;
pub mod matrix;
mod norm;
mod paged;
mod safetensors_header;
mod simd;
mod unet;
mod weights_error;
mod weights_file;

pub use diffusion::{Denoiser, Held, Refinement, Sampler, SamplerScratch, Solver, UnknownSolver};
pub use fast_model::{
    CandidateInput, EvaluationsRefused, FastModel, FastScratch, FeatureFrame, WarmStart,
};
pub use manifest::Manifest;
pub use manifest_entry::ManifestEntry;
pub use matrix::Precision;
pub use unet::{FRAME, HORIZON, Normalisation, TemporalUnet, UnetCondition, UnetScratch};
pub use weights_error::{ContentError, WeightsError};
pub use weights_file::WeightsFile;
