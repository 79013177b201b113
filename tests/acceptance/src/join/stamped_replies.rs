//! Round trips by the stamps that `pcc latency` writes.

/// How far a percentile of a histogram of three digits may be from the value.
pub(super) const DIGITS: f64 = 1e-3;

/// A reply by the stamps of `pcc latency --stamps FILE`, nanoseconds; in a closed loop it is sent when it is due.
pub(super) struct StampedReply {
    pub(super) due_ns: i64,
    pub(super) sent_ns: i64,
    pub(super) answered_ns: i64,
}

impl StampedReply {
    /// Those of a file.
    pub(super) fn all(text: &str) -> Vec<Self> {
        let of_line = |line: &str| {
            let stamps: Vec<i64> = line.split(' ').filter_map(|it| it.parse().ok()).collect();
            let [due_ns, sent_ns, answered_ns] = *stamps.as_slice() else {
                return None;
            };
            Some(Self {
                due_ns,
                sent_ns,
                answered_ns,
            })
        };
        text.lines().filter_map(of_line).collect()
    }

    /// From when it was due until it was answered, ms.
    pub(super) fn took_ms(&self) -> f64 {
        (self.answered_ns - self.due_ns) as f64 * 1e-6
    }
}
