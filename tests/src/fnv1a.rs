//! The hash FNV-1a of 64 bits, for bytes that two programs received.

use client::PlanAnswer;
use shared_types::message::Knot;

/// The hash of no byte.
pub const OF_NOTHING: u64 = 0xcbf2_9ce4_8422_2325;
const _: () = assert!(size_of::<Knot>() == 19 * size_of::<f64>());
const PRIME: u64 = 0x0100_0000_01b3;

/// The hash of bytes after those that `hash` is of.
#[must_use]
pub fn add(hash: u64, bytes: impl IntoIterator<Item = u8>) -> u64 {
    bytes.into_iter().fold(hash, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(PRIME)
    })
}

/// The hash of the bytes of all candidates' knots.
#[must_use]
pub fn of_knots(answer: &PlanAnswer) -> u64 {
    let candidates = answer.candidates();
    candidates.fold(OF_NOTHING, |hash, candidate| {
        add(hash, bytes_of(candidate.knots))
    })
}

/// The bytes of knots: their numbers in the order of the fields, between which there is nothing.
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
