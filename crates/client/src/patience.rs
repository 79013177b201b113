//! How to wait for another process: first without pause, then asleep for most of the usual wait, then with short pauses,
//! cleaning up after the dead in between.

use std::hint;
use std::iter::{once, repeat};
use std::thread;
use std::time::{Duration, Instant};

use shared_types::ipc::IpcNode;

/// Polls without pause before the first sleep: some 20 µs, more than a message takes on its way.
const SPINS: u32 = 200;
/// The first sleep ends when this part of the shortest wait that is usual is over: each look keeps whoever computes the answer
/// from its work.
const FIRST_SLEEP: f64 = 0.8;
/// It is no longer than this, so that a server that died is noticed.
const LONGEST_SLEEP: Duration = Duration::from_millis(10);
/// The first answers tell of nothing longer than this: they may be slow for reasons of their own.
const AT_FIRST: Duration = Duration::from_millis(1);
/// What the usual wait grows by from one to the next that is no shorter.
const GROWTH: f64 = 1.05;
/// What is left of the usual wait where the answer was there before the first sleep ended, nobody knows since when.
const AFTER_OVERSLEEPING: u32 = 4;
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

/// When a wait was over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Moment {
    /// Before the first sleep.
    Early,
    /// Some time during the first sleep.
    Overslept,
    /// Between two of the looks after it.
    Seen,
}

/// The shortest time that an answer usually takes from its request on.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Habit {
    shortest: Duration,
}

impl Habit {
    /// A sleep that ends before the answer comes, if that is as usual, to a request that was sent `age` ago; it leaves half of
    /// the time until a deadline.
    pub(crate) fn first_sleep(self, age: Duration, deadline: Option<Duration>) -> Duration {
        let left = deadline.map_or(Duration::MAX, |deadline| deadline.saturating_sub(age));
        let usual = self.shortest.mul_f64(FIRST_SLEEP).saturating_sub(age);
        usual.min(left / 2).min(LONGEST_SLEEP)
    }

    /// Takes note of an answer that was seen so long after its request.
    pub(crate) fn learn(&mut self, moment: Moment, age: Duration) {
        match moment {
            Moment::Early => {}
            Moment::Overslept => self.shortest /= AFTER_OVERSLEEPING,
            Moment::Seen if self.shortest.is_zero() => self.shortest = age.min(AT_FIRST),
            Moment::Seen => self.shortest = self.shortest.mul_f64(GROWTH).min(age),
        }
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
) -> Result<Option<(T, Moment)>, E> {
    for _ in 0..SPINS {
        if let Some(value) = poll()? {
            return Ok(Some((value, Moment::Early)));
        }
        hint::spin_loop();
    }
    let sleeps = once((first_sleep, Moment::Overslept)).chain(repeat((PAUSE, Moment::Seen)));
    let sleeps = sleeps.skip_while(|(sleep, _)| sleep.is_zero());
    for (sleep, moment) in sleeps {
        if patience.is_exhausted() {
            break;
        }
        cleaner.clean_if_due(node);
        thread::sleep(sleep.min(patience.rest()));
        if let Some(value) = poll()? {
            return Ok(Some((value, moment)));
        }
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHORT: Duration = Duration::from_millis(2);
    const LONG: Duration = Duration::from_millis(8);

    fn used_to(waits: &[Duration]) -> Habit {
        let mut habit = Habit::default();
        waits
            .iter()
            .for_each(|wait| habit.learn(Moment::Seen, *wait));
        habit
    }

    fn first_sleep(habit: Habit) -> Duration {
        habit.first_sleep(Duration::ZERO, None)
    }

    #[test]
    fn the_first_sleep_ends_before_the_shortest_usual_wait_and_is_no_longer_than_allowed() {
        assert_eq!(first_sleep(Habit::default()), Duration::ZERO);
        assert_eq!(first_sleep(used_to(&[LONG])), AT_FIRST.mul_f64(FIRST_SLEEP));
        let habit = used_to(&[[LONG; 50].as_slice(), &[SHORT, LONG, LONG]].concat());
        assert!((SHORT.mul_f64(0.75)..SHORT).contains(&first_sleep(habit)));
        let age = Duration::from_millis(1);
        assert_eq!(habit.first_sleep(age, None), first_sleep(habit) - age);
        assert_eq!(habit.first_sleep(LONG, None), Duration::ZERO, "it is due");
        assert_eq!(habit.first_sleep(Duration::ZERO, Some(SHORT)), SHORT / 2);
        assert_eq!(first_sleep(used_to(&[LONG * 100; 200])), LONGEST_SLEEP);
    }

    #[test]
    fn what_is_usual_is_unlearned() {
        let habit = used_to(&[&[SHORT], [LONG; 100].as_slice()].concat());
        assert_eq!(first_sleep(habit), LONG.mul_f64(FIRST_SLEEP));
        let mut overslept = habit;
        overslept.learn(Moment::Early, Duration::ZERO);
        assert_eq!(overslept, habit, "nothing was waited for");
        overslept.learn(Moment::Overslept, LONG);
        assert_eq!(overslept.shortest, habit.shortest / AFTER_OVERSLEEPING);
    }
}
