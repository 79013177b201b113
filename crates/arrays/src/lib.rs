//! NumPy files: one array (npy), and archives of named arrays (npz).
//!
//! Files may be damaged or hostile. A reader takes memory only for what its caller has seen the shape of, and accepts a
//! file only if every byte of it is accounted for: an array fills its file or its member of the archive exactly, an
//! archive's checksums hold, and nothing lies before, between or behind its members.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod npy;
mod npz;

pub use npy::{NpyArray, NpyError};
pub use npyz::{AutoSerialize, DType, Deserialize, TypeChar};
pub use npz::{ArchiveError, ArchiveReader, ArchiveWriter, MAX_ARCHIVE_BYTES};
