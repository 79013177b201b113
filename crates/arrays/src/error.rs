//! Why an array is refused.

use thiserror::Error;

/// Longest text of a header that is read or written; NumPy's have some hundred bytes.
pub(crate) const MAX_HEADER: usize = 1024;

/// Why an array is refused.
#[derive(Debug, Error)]
pub enum NpyError {
    /// The file does not begin as an array does, or its header is not understood.
    #[error(
        "not a NumPy array: {0}; `\\x93NUMPY`, version 1.0, 2.0 or 3.0, and a header of at most {MAX_HEADER} bytes with descr, fortran_order and shape are needed"
    )]
    Header(String),
    /// The product of the shape is beyond what can be counted.
    #[error(
        "shape {shape:?} has more bytes than can be counted; at most {} are allowed",
        u64::MAX
    )]
    Overflow {
        /// Shape of the array, by its header.
        shape: Vec<u64>,
    },
    /// There are fewer or more bytes than the shape needs.
    #[error("shape {shape:?} of {descr} needs {needed} bytes behind the header, there are {found}")]
    Size {
        /// Shape of the array, by its header.
        shape: Vec<u64>,
        /// Type of the values, as NumPy writes it.
        descr: String,
        /// Bytes that the shape needs.
        needed: u64,
        /// Bytes behind the header.
        found: u64,
    },
    /// The first index runs fastest.
    #[error("fortran_order is True, column-major; False, row-major (C) order, is needed")]
    ColumnMajor,
    /// The values are of another type, or cannot be read; a checksum that does not hold shows here.
    #[error("{0}; undamaged values, as many as the shape says, are needed")]
    Values(#[from] std::io::Error),
    /// There is not as much memory as the values need.
    #[error(
        "shape {shape:?} needs more memory than there is; at most as many values as fit into it are allowed"
    )]
    Memory {
        /// Shape of the array, by its header.
        shape: Vec<u64>,
    },
}
