//! The messages between the processes, their validated types, and the services that carry them.
//!
//! * [`message`]: the wire types: `repr(C)`, arrays and counts only, no padding, so that C and Python match byte for byte;
//! * [`codes`]: what each `u32` code on the wire means;
//! * [`valid`]: one checked type a message (set-points have none), converted in one place, which rejects and never clamps;
//! * [`ipc`]: the node, the services and the exclusive roles;
//! * [`clock`], [`lateness`], [`capacity`]: the time base, the loop histogram, and the sizes of all arrays.
//!
//! Units are SI throughout: metres, radians, seconds; stamps are nanoseconds of `CLOCK_MONOTONIC`.
//! Another process can write any bit pattern into shared memory: copy a message once, then convert it.
#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod capacity;
pub mod clock;
pub use codes;
pub mod ipc;
pub mod lateness;
pub mod message;
pub mod valid;

/// The version of every message in this crate; a request of another version is answered with `wrong version`.
pub const PROTOCOL_VERSION: u32 = 7;
