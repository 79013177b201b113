//! The fastest motion so far, and when a path that must beat it has lost.

use std::cell::Cell;
use std::sync::atomic::{AtomicU64, Ordering};

/// A corrected path whose least duration is this much above what it must beat is not timed, and one whose motion is, not certified: the
/// curve that is executed, which bounding jerk rounds at turns, and another correction may be a little faster.
pub(super) const SURELY_SLOWER: f64 = 1.02;
/// A path whose least duration is this much above what it must beat is given up between two pushes: the next ones may make it a little
/// faster again.
const GIVEN_UP: f64 = 1.3;

/// The shortest duration of any motion so far.
pub(crate) struct ShortestDuration(AtomicU64);

impl ShortestDuration {
    pub(crate) fn none() -> Self {
        Self(AtomicU64::new(f64::INFINITY.to_bits()))
    }

    /// The shortest duration of any motion so far, s; infinite where there is none.
    pub(crate) fn duration_s(&self) -> f64 {
        f64::from_bits(self.0.load(Ordering::Relaxed))
    }

    /// Takes note of the duration of a motion, s, not negative: such numbers are ordered as their bits are.
    pub(crate) fn note(&self, duration_s: f64) {
        self.0.fetch_min(duration_s.to_bits(), Ordering::Relaxed);
    }
}

/// What a path must beat: the shortest duration of any motion so far. It keeps in mind the largest bound on the path's own duration, so
/// that whether the path loses does not depend on when the shortest duration became known.
pub(crate) struct Incumbent<'a> {
    shortest: &'a ShortestDuration,
    /// The largest bound on the duration of the path itself so far, s.
    longest_bound_s: Cell<f64>,
}

impl<'a> Incumbent<'a> {
    pub(crate) fn new(shortest: &'a ShortestDuration) -> Self {
        Self {
            shortest,
            longest_bound_s: Cell::new(0.0),
        }
    }

    /// The largest bound on the duration of the path itself so far, s.
    pub(crate) fn longest_bound_s(&self) -> f64 {
        self.longest_bound_s.get()
    }

    /// Keeps in mind a bound on the duration of a path that is still pushed; whether the incumbent is surely faster.
    pub(super) fn beats_while_pushed(&self, least_s: f64) -> bool {
        self.beats(least_s / GIVEN_UP)
    }

    /// Keeps in mind the duration of a path that is to be certified, or a bound on it before it is timed; whether the
    /// incumbent is surely faster.
    pub(super) fn beats_uncertified(&self, duration_s: f64) -> bool {
        self.beats(duration_s / SURELY_SLOWER)
    }

    /// Keeps in mind a certified motion's duration, s; whether the incumbent is faster.
    pub(super) fn beats(&self, duration_s: f64) -> bool {
        let longest_s = self.longest_bound_s.get().max(duration_s);
        self.longest_bound_s.set(longest_s);
        longest_s > self.shortest.duration_s()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_once_been_too_slow_for_a_rival_stays_so() {
        let shortest = ShortestDuration::none();
        let incumbent = Incumbent::new(&shortest);
        assert!(
            !incumbent.beats_while_pushed(10.0 * GIVEN_UP),
            "nobody is faster"
        );
        assert!(!incumbent.beats_uncertified(9.0));
        assert!(!incumbent.beats(9.5));
        assert!((incumbent.longest_bound_s() - 10.0).abs() < 1e-12);
        shortest.note(9.8);
        assert!(incumbent.beats(9.5), "it would have been stopped before");
        shortest.note(11.0);
        assert_eq!(shortest.duration_s(), 9.8);
        assert!(
            !Incumbent::new(&shortest).beats(9.8),
            "as fast as the fastest"
        );
    }
}
