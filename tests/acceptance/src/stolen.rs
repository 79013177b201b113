//! When processors were away from every program: with their host, or in the kernel.
//!
//! `/proc/stat` tells of the host alone, and to a hundredth of a second. Here a sentry sleeps on each processor at a real-time
//! priority above that of all programs looked at, so while it is late, none of them had the processor. A sentry that cannot take
//! its place tells of nothing stolen.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use realtime::use_fifo_priority;
use tests::priority::OF_A_SENTRY;

use crate::machine::{Pinned, processors};

/// Of a sentry.
const NAP: Duration = Duration::from_micros(250);
/// Sleeps end this much later than asked for though the processor is there.
const PUNCTUAL: Duration = Duration::from_micros(100);

type Interval = (Instant, Instant);

/// Watches until it is dropped.
pub(crate) struct StolenTimes {
    away: Arc<Mutex<Vec<Interval>>>,
    quit: Arc<AtomicBool>,
    sentries: Vec<JoinHandle<anyhow::Result<()>>>,
}

impl StolenTimes {
    /// Begins to look.
    ///
    /// # Errors
    /// Where the system does not permit a real-time priority: an ordinary thread also waits for other programs.
    pub(crate) fn watch() -> anyhow::Result<Self> {
        thread::spawn(|| use_fifo_priority(OF_A_SENTRY))
            .join()
            .expect("it does not panic")?;
        let (away, quit) = (Arc::default(), Arc::default());
        let sentry = |processor| {
            let (away, quit) = (Arc::clone(&away), Arc::clone(&quit));
            thread::spawn(move || stand_sentry(processor, &away, &quit))
        };
        let sentries = processors()?.into_iter().map(sentry).collect();
        Ok(Self {
            away,
            quit,
            sentries,
        })
    }

    /// Time between two instants in which a processor, or several, was away.
    pub(crate) fn between(&self, begin: Instant, end: Instant) -> Duration {
        let away = self.away.lock().unwrap();
        let within = |(from, to): &Interval| ((*from).max(begin), (*to).min(end));
        let mut intervals: Vec<Interval> = away.iter().map(within).collect();
        intervals.sort_unstable();
        union(&intervals)
    }
}

/// Time that intervals cover, in the order of their begins; one that ends before it begins covers nothing.
fn union(intervals: &[Interval]) -> Duration {
    let (mut total, mut covered) = (Duration::ZERO, None);
    for &(from, to) in intervals {
        let from = covered.map_or(from, |covered| from.max(covered));
        if to > from {
            total += to - from;
            covered = Some(to);
        }
    }
    total
}

fn stand_sentry(
    processor: usize,
    away: &Mutex<Vec<Interval>>,
    quit: &AtomicBool,
) -> anyhow::Result<()> {
    let _pinned = Pinned::to(processor)?;
    use_fifo_priority(OF_A_SENTRY)?;
    while !quit.load(Ordering::Relaxed) {
        let waking = Instant::now() + NAP;
        thread::sleep(NAP);
        let awake = Instant::now();
        if awake > waking + PUNCTUAL {
            away.lock().unwrap().push((waking, awake));
        }
    }
    Ok(())
}

impl Drop for StolenTimes {
    fn drop(&mut self) {
        self.quit.store(true, Ordering::Relaxed);
        for sentry in self.sentries.drain(..) {
            let _ = sentry.join();
        }
    }
}

#[cfg(test)]
mod unit {
    use super::*;

    #[test]
    fn what_is_stolen_is_what_lies_between_the_instants() {
        let origin = Instant::now();
        let at = |ms: u64| origin + Duration::from_millis(ms);
        let times = StolenTimes {
            away: Arc::new(Mutex::new(vec![(at(2), at(4)), (at(3), at(8))])),
            quit: Arc::default(),
            sentries: Vec::new(),
        };
        let between = |begin, end| times.between(at(begin), at(end)).as_millis();
        assert_eq!(between(0, 2), 0);
        assert_eq!(between(0, 10), 6);
        assert_eq!(between(3, 5), 2);
        assert_eq!(between(8, 10), 0);
    }
}
