//! Time for which a thread ran: pauses of the whole machine do not count against other processes.

/// Most of the time between two readings of the clock that counts, nanoseconds: longer than the certification of a scene between them.
const MAX_INTERVAL_NS: i64 = 20_000_000;

/// Sum of the times between readings of the clock, each counted up to [`MAX_INTERVAL_NS`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct ActiveTime {
    total_ns: i64,
    last_mono_ns: i64,
}

impl ActiveTime {
    pub(crate) fn from(now_mono_ns: i64) -> Self {
        Self {
            total_ns: 0,
            last_mono_ns: now_mono_ns,
        }
    }

    /// Looks at the clock; the time counted so far, nanoseconds.
    pub(crate) fn look(&mut self, now_mono_ns: i64) -> i64 {
        let elapsed_ns = now_mono_ns.saturating_sub(self.last_mono_ns);
        self.last_mono_ns = now_mono_ns;
        self.total_ns += elapsed_ns.clamp(0, MAX_INTERVAL_NS);
        self.total_ns
    }

    /// The time counted at the last look, nanoseconds.
    pub(crate) fn total_ns(&self) -> i64 {
        self.total_ns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn looks_are_counted_by_their_time_and_a_pause_for_little() {
        let mut awake = ActiveTime::from(100);
        assert_eq!(awake.look(1_000_100), 1_000_000);
        for _ in 0..9 {
            awake.look(1_000_100);
        }
        assert_eq!(awake.total_ns(), 1_000_000, "looks that take no time");
        assert_eq!(awake.look(19_000_100), 19_000_000, "a long certificate");
        assert_eq!(awake.look(60_000_000_000), 39_000_000);
    }
}
