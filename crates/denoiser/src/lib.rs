//! Learned samplers: weights files and their manifest, and the few-step path sampler. f32 slices in and out.
//!
//! This crate knows no robot and no processes: what the numbers mean is its caller's business.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod diffusion;
mod flow_model;
pub mod gemm;
mod layers;
mod simd;
mod unet;
mod weights;

pub use diffusion::{Denoiser, Held, Refinement, Sampler, SamplerScratch, Solver, UnknownSolver};
pub use flow_model::{
    CandidateInput, EvaluationsRefused, FastModel, FastScratch, FeatureFrame, WarmStart,
};
pub use gemm::Precision;
pub use unet::{FRAME, HORIZON, Normalisation, TemporalUnet, UnetCondition, UnetScratch};
pub use weights::error::{ContentError, WeightsError};
pub use weights::file::WeightsFile;
pub use weights::manifest::Manifest;
pub use weights::manifest_entry::ManifestEntry;
