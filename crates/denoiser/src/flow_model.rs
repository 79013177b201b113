//! The learned few-step sampler of paths.

mod few_step_model;
mod flow;

pub use few_step_model::{CandidateInput, FastModel, FastScratch, FeatureFrame, WarmStart};
pub use flow::EvaluationsRefused;
