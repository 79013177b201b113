//! Waiting for another process: polling with a time limit, and the clean-up of dead nodes meanwhile.

use std::time::{Duration, Instant};

use shared_types::ipc::IpcNode;

/// Time between two polls where no event is sent, or an answer is overdue.
pub(crate) const POLL_INTERVAL: Duration = Duration::from_micros(50);
/// Time between two clean-ups of dead processes.
const CLEANUP_PERIOD: Duration = Duration::from_millis(100);

/// A time limit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TimeLimit {
    begin: Instant,
    limit: Duration,
}

impl TimeLimit {
    pub(crate) fn new(limit: Duration) -> Self {
        Self {
            begin: Instant::now(),
            limit,
        }
    }

    pub(crate) fn is_over(&self) -> bool {
        self.begin.elapsed() >= self.limit
    }

    fn remaining(&self) -> Duration {
        self.limit.saturating_sub(self.begin.elapsed())
    }

    /// The whole duration, for messages.
    pub(crate) fn duration(&self) -> Duration {
        self.limit
    }
}

/// Cleans up after dead processes, but not too often: it lists a directory.
#[derive(Debug)]
pub(crate) struct Cleaner {
    last: Option<Instant>,
}

impl Cleaner {
    pub(crate) const fn new() -> Self {
        Self { last: None }
    }

    /// Starts a new period: the next clean-up is due at its end.
    pub(crate) fn begin_period(&mut self) {
        self.last = Some(Instant::now());
    }

    /// Makes the next clean-up due now.
    pub(crate) fn make_due(&mut self) {
        self.last = None;
    }

    /// Cleans up if the period since the last time is over.
    pub(crate) fn clean_if_due(&mut self, node: &IpcNode) {
        if self
            .last
            .is_none_or(|last| last.elapsed() >= CLEANUP_PERIOD)
        {
            node.clean_dead_nodes();
            self.begin_period();
        }
    }
}

/// Calls `poll` until it returns a value or fails, or the limit is over (none). In between it calls `pause` with the time that is left.
pub(crate) fn wait<T, E>(
    limit: &TimeLimit,
    cleaner: &mut Cleaner,
    node: &IpcNode,
    mut pause: impl FnMut(Duration),
    mut poll: impl FnMut() -> Result<Option<T>, E>,
) -> Result<Option<T>, E> {
    loop {
        if let Some(value) = poll()? {
            return Ok(Some(value));
        }
        if limit.is_over() {
            return Ok(None);
        }
        cleaner.clean_if_due(node);
        pause(limit.remaining());
    }
}
