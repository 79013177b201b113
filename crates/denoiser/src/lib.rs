//! Learned samplers: weights files and their manifest, and the few-step path sampler. f32 slices in and out.
//!
//! This crate knows no robot and no processes: what the numbers mean is its caller's business.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod activation;
mod fast_model;
mod lanes;
mod linear;
mod manifest;
pub mod matrix;
mod norm;
mod simd;
mod weights_file;

pub use fast_model::{CandidateInput, FastModel, FastScratch};
pub use manifest::{Manifest, ManifestEntry};
pub use weights_file::{WeightsError, WeightsFile};
