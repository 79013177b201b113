//! Loops that are compiled for each kind of vectors and run with the widest that the processor has.

pub(crate) mod dispatch;
pub(crate) mod lanes;
pub(crate) mod prefetch;
pub(crate) mod token;
