//! Files of one NumPy array (npy), versions 1.0, 2.0 and 3.0 of the format: numbers, little-endian, row-major.
//!
//! Files may be damaged or hostile. A reader takes memory only for what its caller has seen the shape of, and accepts a
//! file only if the array fills it exactly.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod error;
mod header;
mod npy;
mod number;

pub use error::NpyError;
pub use npy::{NpyArray, write_npy};
pub use number::Number;
