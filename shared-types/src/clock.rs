//! The one time base of all messages.

use rustix::time::{ClockId, clock_gettime};

/// Now, nanoseconds of `CLOCK_MONOTONIC`: the same in every process of this machine, no allocation, no lock.
#[must_use]
pub fn mono_now_ns() -> i64 {
    now_ns(ClockId::Monotonic)
}

/// Age of a controller's state beyond which it says nothing of the present, nanoseconds.
pub const STATE_LIFETIME_NS: i64 = 200_000_000;

/// The time of day now, nanoseconds since 1970: only to tell a stamp of that clock from one of ours.
#[must_use]
pub fn wall_now_ns() -> i64 {
    now_ns(ClockId::Realtime)
}

/// Time for which the machine was suspended since it was booted, ns: CLOCK_MONOTONIC stood still meanwhile.
#[must_use]
pub fn suspended_ns() -> i64 {
    now_ns(ClockId::Boottime) - mono_now_ns()
}

/// Suspensions of the machine in all that count as one, ns: the two clocks are not read at the same instant.
const SUSPENDED_NS: i64 = 100_000_000;

/// Time for which the machine has been suspended since it was booted, as far as that was noticed, ns.
#[derive(Clone, Copy, Debug)]
pub struct Suspension(i64);

impl Suspension {
    /// With `suspended_ns` noticed already.
    #[must_use]
    pub const fn noticed(suspended_ns: i64) -> Self {
        Self(suspended_ns)
    }

    /// Whether the machine has been suspended for 0.1 s more than was noticed; true once.
    pub fn is_longer(&mut self, suspended_ns: i64) -> bool {
        let is_longer = suspended_ns - self.0 > SUSPENDED_NS;
        if is_longer {
            self.0 = suspended_ns;
        }
        is_longer
    }
}

/// An interval in seconds; exact to a nanosecond below 104 days.
#[must_use]
pub fn seconds(interval_ns: i64) -> f64 {
    interval_ns as f64 * 1e-9
}

fn now_ns(clock: ClockId) -> i64 {
    let now = clock_gettime(clock);
    now.tv_sec * 1_000_000_000 + now.tv_nsec
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_suspension_is_noticed_once() {
        let mut suspension = Suspension::noticed(7);
        assert!(!suspension.is_longer(7 + SUSPENDED_NS));
        assert!(suspension.is_longer(8 + SUSPENDED_NS));
        assert!(!suspension.is_longer(9 + SUSPENDED_NS));
    }

    #[test]
    fn never_runs_backwards_and_moves() {
        let first = mono_now_ns();
        let mut last = first;
        while last == first {
            let now = mono_now_ns();
            assert!(now >= last);
            last = now;
        }
    }
}
