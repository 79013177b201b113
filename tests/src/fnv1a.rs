//! The hash FNV-1a of 64 bits, for bytes that two programs received.

use client::PlanAnswer;
use shared_types::message::Knot;

/// Of no byte.
const NONE: u64 = 0xcbf2_9ce4_8422_2325;
const PRIME: u64 = 0x0100_0000_01b3;

/// The hash of bytes after those that `hash` is of.
#[must_use]
pub fn add(hash: u64, bytes: impl IntoIterator<Item = u8>) -> u64 {
    bytes.into_iter().fold(hash, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(PRIME)
    })
}

/// The hash of all candidates' knots, as they lie in memory.
#[must_use]
pub fn of_knots(answer: &PlanAnswer) -> u64 {
    let candidates = answer.candidates();
    candidates.fold(NONE, |hash, candidate| add(hash, bytes_of(candidate.knots)))
}

/// The bytes of knots, as they lie in memory.
pub fn bytes_of(knots: &[Knot]) -> impl Iterator<Item = u8> {
    let numbers = knots.iter().flat_map(|knot| {
        [
            &[knot.time_s][..],
            &knot.configuration_rad,
            &knot.velocity_rad_s,
            &knot.acceleration_rad_s2,
        ]
        .concat()
    });
    numbers.flat_map(f64::to_ne_bytes)
}
