//! The hard loop's own memory: a preallocated constant-time arena that only the loop thread allocates from.
//!
//! Sending through iceoryx2 0.10 costs one small heap block. So that this block is bounded in time and no lock is
//! shared with other threads, allocations that the loop thread makes inside a cycle come from a TLSF pool (two-level
//! segregated fit, Masmano et al. 2004, crate `rlsf`) in a static region. A block may be freed by any thread: frees are
//! routed by address, and those of other threads travel back to the owner through a lock-free intrusive stack.

#![allow(
    unsafe_code,
    reason = "an allocator hands out raw memory and shares it between threads"
)]

mod allocator;
mod pool;

pub use allocator::{LoopAllocator, LoopMemory, MemoryCounts};
