//! Where a motion is on its path, and how soon it may pass the rest.

use shared_types::clock::{STATE_LIFETIME_NS, seconds};
use shared_types::message::ControllerState;

use super::moving_ball_cover::{Stretch, Timing, UNSUPERVISED_S};

/// The place of a motion on its path at a clock time, and its rate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Progress {
    /// Path time, s; below 0 before its begin.
    pub(crate) time_s: f64,
    /// Clock time, nanoseconds of `CLOCK_MONOTONIC`.
    pub(crate) mono_ns: i64,
    /// Seconds of path time a second of the clock, 0 to 1.
    pub(crate) rate: f64,
}

impl Progress {
    /// A motion that begins at full rate.
    pub(crate) fn from_begin(begin_mono_ns: i64) -> Self {
        Self {
            time_s: 0.0,
            mono_ns: begin_mono_ns,
            rate: 1.0,
        }
    }

    /// The place of the motion that a controller executes, by its state.
    pub(crate) fn told_by(state: &ControllerState) -> Self {
        Self {
            time_s: state.trajectory_time_s,
            mono_ns: state.stamp_mono_ns,
            rate: state.rate,
        }
    }

    /// The place of a motion that leaves this one at a path time, s: as far before its begin as this one is before that.
    pub(crate) fn of_joining_motion(self, switch_s: f64) -> Self {
        Self {
            time_s: self.time_s - switch_s,
            ..self
        }
    }

    /// Path time that has passed for certain, s.
    pub(crate) fn passed_s(self) -> f64 {
        self.time_s.max(0.0)
    }

    /// The timing of the rest of the path at this rate.
    pub(crate) fn timing(self) -> Timing {
        Timing::passing(self.time_s, self.mono_ns, self.rate)
    }

    /// The path of this duration, s, that a slowed motion may pass at full rate, until a state has told of the change, or the loss of
    /// supervision has been noticed, and a stop, s, is over; none where it is not slowed, or will not have begun by then.
    pub(super) fn at_full_rate(self, stopping_s: f64, duration_s: f64) -> Option<Stretch> {
        let ahead_s = seconds(STATE_LIFETIME_NS) + UNSUPERVISED_S + stopping_s;
        let until_s = (self.time_s + ahead_s).min(duration_s);
        (self.rate < 1.0 && until_s > 0.0).then(|| Stretch {
            timing: Timing::passing(self.time_s, self.mono_ns, 1.0),
            until_s,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOW: i64 = 10_000_000_000;

    #[test]
    fn a_slowed_motion_and_the_one_that_leaves_it_may_hurry_until_a_state_is_missed_and_a_stop_is_over()
     {
        let slowed = Progress {
            time_s: 0.5,
            mono_ns: NOW,
            rate: 0.05,
        };
        let hurried = slowed.at_full_rate(0.25, 2.0).unwrap();
        assert_eq!(hurried.timing, Timing::passing(0.5, NOW, 1.0));
        assert!((hurried.until_s - 1.3).abs() < 1e-12, "{hurried:?}");
        let hurried = slowed
            .of_joining_motion(0.75)
            .at_full_rate(0.25, 2.0)
            .unwrap();
        assert_eq!(hurried.timing, Timing::from_begin(NOW + 250_000_000));
        assert!((hurried.until_s - 0.55).abs() < 1e-12, "{hurried:?}");
        assert_eq!(slowed.of_joining_motion(1.5).at_full_rate(0.25, 2.0), None);
        assert_eq!(slowed.at_full_rate(0.25, 0.75).unwrap().until_s, 0.75);
        let full = Progress {
            rate: 1.0,
            ..slowed
        };
        assert_eq!(full.at_full_rate(0.25, 2.0), None);
    }

    #[test]
    fn a_motion_that_has_not_begun_has_passed_nothing_and_is_timed_from_the_switch() {
        let next = Progress {
            time_s: 0.5,
            mono_ns: NOW,
            rate: 0.5,
        };
        let next = next.of_joining_motion(0.75);
        assert_eq!((next.time_s, next.passed_s()), (-0.25, 0.0));
        assert_eq!(next.timing(), Timing::passing(-0.25, NOW, 0.5));
    }
}
