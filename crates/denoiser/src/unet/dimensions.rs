//! The sizes of the network, and what the metadata of its weights says of it.

pub(super) const ARCHITECTURE: &str = "temporal-unet-v1";
/// What the metadata says of the schedule that [`crate::ReverseProcess`] follows.
pub(super) const SCHEDULE: &str =
    "cosine, offset 0.008, betas within [1e-8, 0.999]; the network predicts the noise";
/// Frames of a path.
pub const HORIZON: usize = 64;
/// Numbers of a frame.
pub const FRAME: usize = 6;
pub(super) const PATH: usize = HORIZON * FRAME;
/// A frame, and whether it is the first.
pub(super) const INPUTS: usize = FRAME + 1;
pub(super) const STAGES: usize = 6;
