//! Products of a constant matrix with many rows: y = W x + b in one of two precisions.
//!
//! The rows may overlap and have any stride, so that a convolution over time is a product on windows of its
//! time-major activations. The rows of several candidates go through together: the weights, which are by far the
//! larger part, are then read once for all of them. Every output is computed from its own row alone in a fixed order,
//! so a row's result does not depend, bit for bit, on the rows beside it or on their number.

#[cfg(target_arch = "x86_64")]
mod amx_available;
mod bf16;
#[cfg(target_arch = "x86_64")]
mod bf16_amx;
#[cfg(target_arch = "x86_64")]
mod bf16_avx512;
mod bf16_panels;
mod bf16_product;
mod bf16_unit;
#[cfg(target_arch = "x86_64")]
mod f32_avx2;
#[cfg(target_arch = "x86_64")]
mod f32_avx512;
mod f32_panels;
mod f32_product;
mod input;
mod job;
mod packed;
pub(crate) mod paged;
mod precision;
#[cfg(test)]
pub(crate) mod presence;

pub use bf16::{Bf16, Bf16Buffer, padded};
pub use bf16_unit::{AmxBf16, Avx512Bf16, Bf16Unit};
pub use input::Input;
pub use job::{Batch, Store, Strides};
pub use packed::Packed;
pub use precision::Precision;
