//! Products of a constant matrix with many rows: y = W x + b in one of two precisions.
//!
//! The rows may overlap and have any stride, so that a convolution over time is a product on windows of its
//! time-major activations. The rows of several candidates go through together: the weights, which are by far the
//! larger part, are then read once for all of them. Every output is computed from its own row alone in a fixed order,
//! so a row's result does not depend, bit for bit, on the rows beside it or on their number.

#[cfg(target_arch = "x86_64")]
mod amx_available;
mod bf16;
mod bf16_panels;
mod bf16_product;
mod bf16_unit;
mod f32_panels;
mod f32_product;
mod input;
mod job;
#[cfg(target_arch = "x86_64")]
mod narrow;
mod packed;
mod precision;
#[cfg(test)]
pub(crate) mod presence;
#[cfg(target_arch = "x86_64")]
mod tiles;
#[cfg(target_arch = "x86_64")]
mod vectors;
#[cfg(target_arch = "x86_64")]
mod wide;

pub use bf16::{Brain, BrainBuffer, padded};
pub use bf16_unit::{Bf16Tiles, Bf16Vectors, Unit};
pub use input::Input;
pub use job::{Batch, Store, Strides};
pub use packed::Packed;
pub use precision::{Precision, UnknownPrecision};
