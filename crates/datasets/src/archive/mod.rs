//! Archives of named arrays: NumPy's npz, a zip file with a member `NAME.npy` for each array.
//!
//! Files may be damaged or hostile: a reader accepts an archive only if its checksums hold and nothing lies before, between or behind
//! its members.

pub(crate) mod error;
mod layout;
pub(crate) mod reader;
pub(crate) mod writer;
