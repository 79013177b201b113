//! Hashes as JSON has them.

/// A hash, which JavaScript and others could not hold as a number.
pub(crate) fn hexadecimal(hash: u64) -> String {
    format!("{hash:016x}")
}
