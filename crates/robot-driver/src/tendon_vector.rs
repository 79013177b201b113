//! Numbers of all tendons.

/// Tendons in every message; robots with fewer leave the rest at zero.
pub const TENDONS: usize = shared_types::capacity::TENDONS;
const _: () = assert!(
    TENDONS == pcc_model::MAX_TENDONS,
    "robot files allow what a message carries"
);

/// One number a tendon.
pub type TendonVector = [f64; TENDONS];
