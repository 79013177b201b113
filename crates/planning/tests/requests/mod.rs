//! A plain request, from which the tests' others differ.

use pcc_model::SECTIONS;
use planning::{MOST_CORRECTIONS, Request, Sampler};

/// Ten candidates from rest to rest, as fast as the robot may, without padding.
pub(crate) fn request(sampler: Sampler, seed: u64) -> Request {
    Request {
        candidates: 10,
        seed,
        sampler,
        limits_scale: 1.0,
        padding: [0.0; SECTIONS],
        knots: 96,
        corrections: MOST_CORRECTIONS,
        start_motion: None,
        previous: None,
        end_to_move: None,
    }
}
