//! The one time base of all messages.

use rustix::time::{ClockId, clock_gettime};

/// Now, nanoseconds of `CLOCK_MONOTONIC`: the same in every process of this machine, no allocation, no lock.
#[must_use]
pub fn mono_now_ns() -> i64 {
    now_ns(ClockId::Monotonic)
}

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

fn now_ns(clock: ClockId) -> i64 {
    let now = clock_gettime(clock);
    now.tv_sec * 1_000_000_000 + now.tv_nsec
}

#[cfg(test)]
mod tests {
    use super::*;

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
