//! The learned models: features in the canonical frame, few-step sampling, and the diffusion of the paper.

pub(crate) mod canonical_frame;
pub(crate) mod diffusion;
pub(crate) mod features;
pub(crate) mod few_step;
pub mod sampled_collision;
