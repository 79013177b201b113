//! The paper's denoiser `temporal-unet-v1`: it estimates the noise in a noisy path, given start, goal and balls.
//!
//! A temporal U-Net (Janner et al., "Planning with Diffusion for Flexible Behavior Synthesis", ICML 2022) over 64
//! frames of 6 numbers, whose residual blocks a context scales and shifts; the context joins the diffusion step, the
//! start, the goal and a graph network over the balls. `scripts/unet_model.py` is the same network in PyTorch; its
//! layers have the same names.
//!
//! All candidates go through a layer together, so that its weights are read once. A candidate's result depends on its
//! own path and the condition alone, bit for bit.

mod block;
mod dimensions;
mod embedding;
mod gradient;
mod gradient_scratch;
mod graph;
mod network;
mod normalisation;

pub use dimensions::{FRAME, HORIZON};
pub use network::{TemporalUnet, UnetCondition, UnetScratch};
pub use normalisation::Normalisation;
