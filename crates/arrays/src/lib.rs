//! Files of one NumPy array (npy).
//!
//! Files may be damaged or hostile. A reader takes memory only for what its caller has seen the shape of, and accepts a
//! file only if the array fills it exactly.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod npy;

pub use npy::{NpyArray, NpyError};
pub use npyz::{DType, Deserialize, TypeChar};
