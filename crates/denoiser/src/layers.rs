//! Layers of the networks, on rows of f32.

pub(crate) mod activation;
pub(crate) mod convolution;
pub(crate) mod factors;
pub(crate) mod group_norm;
pub(crate) mod layer_norm;
pub(crate) mod linear;
