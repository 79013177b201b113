//! The grid of a loop's deadlines.

use shared_types::clock::mono_now_ns;

/// Deadlines one period apart; those that were missed are left out.
pub(super) struct PeriodicDeadlines {
    deadline_ns: i64,
    period_ns: i64,
}

impl PeriodicDeadlines {
    /// Deadlines from now on.
    pub(super) fn from_now(period_ns: i64) -> Self {
        Self {
            deadline_ns: mono_now_ns(),
            period_ns,
        }
    }

    /// Waits for the next deadline that is still ahead; returns it, ns of CLOCK_MONOTONIC.
    pub(super) fn wait(&mut self) -> i64 {
        self.deadline_ns = next_deadline(self.deadline_ns, mono_now_ns(), self.period_ns);
        realtime::sleep_until(self.deadline_ns);
        self.deadline_ns
    }
}

/// The first deadline on the grid of periods that is still ahead.
fn next_deadline(deadline_ns: i64, now_ns: i64, period_ns: i64) -> i64 {
    let missed = (now_ns - deadline_ns).max(0) / period_ns;
    deadline_ns + (missed + 1) * period_ns
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deadlines_stay_on_the_grid_and_missed_ones_are_left_out() {
        let cases = [
            (0, 1_000),
            (999, 1_000),
            (1_000, 2_000),
            (5_300, 6_000),
            (-200, 1_000),
        ];
        for (now_ns, expected) in cases {
            assert_eq!(next_deadline(0, now_ns, 1_000), expected, "at {now_ns}");
        }
    }
}
