//! How to wait for another process: at rest between two looks, cleaning up after the dead.

use std::time::{Duration, Instant};

use shared_types::ipc::IpcNode;

/// Rest between two polls where nobody tells of news, or news is overdue.
pub(crate) const PAUSE: Duration = Duration::from_micros(50);
/// Time between two clean-ups of dead processes.
const CLEANING_PERIOD: Duration = Duration::from_millis(100);

/// A time limit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Patience {
    begin: Instant,
    limit: Duration,
}

impl Patience {
    pub(crate) fn new(limit: Duration) -> Self {
        Self {
            begin: Instant::now(),
            limit,
        }
    }

    pub(crate) fn is_exhausted(&self) -> bool {
        self.begin.elapsed() >= self.limit
    }

    fn rest(&self) -> Duration {
        self.limit.saturating_sub(self.begin.elapsed())
    }

    /// The limit, for messages.
    pub(crate) fn limit(&self) -> Duration {
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

    /// From now on it is a whole period until the next time.
    pub(crate) fn begin_period(&mut self) {
        self.last = Some(Instant::now());
    }

    /// It is time, however long ago the last time is.
    pub(crate) fn make_due(&mut self) {
        self.last = None;
    }

    /// Cleans if the last time is long enough ago.
    pub(crate) fn clean_if_due(&mut self, node: &IpcNode) {
        if self
            .last
            .is_none_or(|last| last.elapsed() >= CLEANING_PERIOD)
        {
            node.clean_dead_nodes();
            self.begin_period();
        }
    }
}

/// Calls `poll` until it has something, fails, or patience ends (none), and `rest` in between, which returns within the time that is
/// left.
pub(crate) fn wait<T, E>(
    patience: &Patience,
    cleaner: &mut Cleaner,
    node: &IpcNode,
    mut rest: impl FnMut(Duration),
    mut poll: impl FnMut() -> Result<Option<T>, E>,
) -> Result<Option<T>, E> {
    loop {
        if let Some(value) = poll()? {
            return Ok(Some(value));
        }
        if patience.is_exhausted() {
            return Ok(None);
        }
        cleaner.clean_if_due(node);
        rest(patience.rest());
    }
}
