//! Learned samplers of paths, f32 slices in and out: a few-step flow model, and the temporal U-Net with its reverse diffusion.
//!
//! [`Manifest`] names the weights of a folder and checks them, [`FastModel`] and [`TemporalUnet`] are the networks,
//! [`ReverseProcess`] runs the U-Net from noise to paths, and [`gemm`] multiplies their matrices in f32 or bf16.
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

pub use diffusion::{Denoiser, Held, Refinement, ReverseProcess, ReverseProcessScratch, Solver};
pub use flow_model::{
    CandidateInput, EvaluationsRefused, FastModel, FastScratch, FeatureFrame, WarmStart,
};
pub use gemm::Precision;
pub use unet::{FRAME, HORIZON, Normalisation, TemporalUnet, UnetCondition, UnetScratch};
pub use weights::error::{ContentError, WeightsError};
pub use weights::file::WeightsFile;
pub use weights::manifest::Manifest;
pub use weights::manifest_entry::ManifestEntry;
