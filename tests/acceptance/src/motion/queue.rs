//! Queues of tips as they were asked for and accepted.

use std::collections::BTreeMap;

use tests::passages::Position;

/// A request whose motion was published.
pub(super) struct Accepted {
    pub(super) trajectory_id: u32,
    pub(super) tips_m: Vec<Position>,
}

/// What was asked for of one queue.
#[derive(Default)]
pub(super) struct Queue {
    /// In the order in which they were accepted.
    pub(super) accepted: Vec<Accepted>,
    /// When the first request was sent and when the robot rested after the last motion, nanoseconds of `CLOCK_MONOTONIC`.
    pub(super) between_mono_ns: [i64; 2],
}

/// How requests came about.
#[derive(Default)]
pub(super) struct Asked {
    pub(super) requests: usize,
    /// Of these, appended while the robot moved.
    pub(super) appended_in_motion: usize,
    /// Refused ones by cause.
    pub(super) refused: BTreeMap<String, usize>,
    pub(super) tips_refused: usize,
    /// Queues whose first request was refused: nothing of them moved.
    pub(super) not_begun: usize,
    /// Queues in one request.
    pub(super) whole: usize,
    /// Scenes in which the robot had room, and those that were drawn for them.
    pub(super) scenes: usize,
    pub(super) scenes_drawn: u64,
}
