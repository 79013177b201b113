//! How to wait for another process: first without pause, then asleep for most of the usual wait, then with short pauses,
//! cleaning up after the dead in between.

use std::hint;
use std::thread;
use std::time::{Duration, Instant};

use shared_types::ipc::IpcNode;

/// Polls without pause before the first sleep: some 20 µs, more than a message takes on its way.
const SPINS: u32 = 200;
/// The first sleep lasts for this part of the shortest wait that is usual: each look keeps whoever computes the answer from
/// its work.
const FIRST_SLEEP: f64 = 0.8;
/// What the usual wait grows by from one to the next that is no shorter.
const GROWTH: f64 = 1.02;
/// Pause between two polls after that.
const PAUSE: Duration = Duration::from_micros(50);
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

/// The shortest wait for an answer that is usual.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Habit {
    shortest: Duration,
}

impl Habit {
    /// A sleep that ends before the answer comes, if it is as usual and its deadline is `time_left` away.
    pub(crate) fn first_sleep(self, time_left: Duration) -> Duration {
        self.shortest.mul_f64(FIRST_SLEEP).min(time_left / 2)
    }

    /// Takes note of a wait; those that were over before the first sleep tell nothing.
    pub(crate) fn learn(&mut self, waited: Duration) {
        if waited < PAUSE {
            return;
        }
        self.shortest = match self.shortest {
            Duration::ZERO => waited,
            shortest => shortest.mul_f64(GROWTH).min(waited),
        };
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

/// Calls `poll` until it has something, fails, or patience ends (none); after a while without pause it first sleeps for
/// `first_sleep`.
pub(crate) fn wait<T, E>(
    patience: &Patience,
    cleaner: &mut Cleaner,
    first_sleep: Duration,
    node: &IpcNode,
    mut poll: impl FnMut() -> Result<Option<T>, E>,
) -> Result<Option<T>, E> {
    for _ in 0..SPINS {
        if let Some(value) = poll()? {
            return Ok(Some(value));
        }
        hint::spin_loop();
    }
    let mut pause = first_sleep.max(PAUSE);
    while !patience.is_exhausted() {
        cleaner.clean_if_due(node);
        thread::sleep(pause.min(patience.rest()));
        if let Some(value) = poll()? {
            return Ok(Some(value));
        }
        pause = PAUSE;
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_sleep_ends_before_the_shortest_usual_wait() {
        let mut habit = Habit::default();
        let far = Duration::from_secs(1);
        habit.learn(Duration::from_micros(1));
        assert_eq!(habit.first_sleep(far), Duration::ZERO, "nothing is known");
        let [short, long] = [Duration::from_millis(2), Duration::from_millis(40)];
        for waited in [long, short, long, long] {
            habit.learn(waited);
        }
        assert!(habit.first_sleep(far) > short.mul_f64(0.75) && habit.first_sleep(far) < short);
        assert_eq!(habit.first_sleep(short), short / 2, "before the deadline");
        for _ in 0..1000 {
            habit.learn(long);
        }
        assert_eq!(
            habit.first_sleep(far),
            long.mul_f64(FIRST_SLEEP),
            "it is unlearned"
        );
    }
}
