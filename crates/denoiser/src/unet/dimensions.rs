//! The sizes of the network, and what the metadata of its weights says of it.

/// The `architecture` in the metadata of weights of this network.
pub(super) const ARCHITECTURE: &str = "temporal-unet-v1";
/// What the metadata says of the schedule that [`crate::ReverseProcess`] follows.
pub(super) const SCHEDULE: &str =
    "cosine, offset 0.008, betas within [1e-8, 0.999]; the network predicts the noise";
/// How many frames a path has.
pub const HORIZON: usize = 64;
/// How many numbers a frame has: the components of a configuration.
pub const FRAME: usize = 6;
/// How many numbers a path has.
pub(super) const PATH: usize = HORIZON * FRAME;
/// Input channels: the numbers of a frame, and one that marks the first frame.
pub(super) const INPUTS: usize = FRAME + 1;
/// Stages of the network: three down, one in the middle, two up.
pub(super) const STAGES: usize = 6;
