//! Whether a motion that is not certified to its end may go on for another round: while a later stop is certified, too, another plan can be
//! joined in time.

use shared_types::clock::seconds;
use trajectory::{Knot, Playback, RateLaw, Trajectory};

use super::rules::{ExecutionRules, ORDER_DELAY_S};
use super::supervised_motion::SupervisedMotion;
use crate::live_scene::{
    Certificates, InTheWay, LiveScene, Progress, RemainingMotion, UNSUPERVISED_S,
};

/// Time until the next round of supervision has looked, s.
const NEXT_ROUND_S: f64 = 0.01;
/// Length of a cycle of the controller's loop, s.
const CYCLE_S: f64 = 1e-3;

/// What a motion is certified against.
pub(super) struct Surroundings<'a> {
    pub(super) rules: &'a ExecutionRules,
    pub(super) live: &'a LiveScene,
    pub(super) now_mono_ns: i64,
}

impl Surroundings<'_> {
    /// Certifies what is left of a motion, and requests a stop where that fails, unless the motion goes on for another round.
    pub(super) fn check(&self, motion: &mut SupervisedMotion, progress: Progress) {
        let mut certificates = std::mem::take(&mut motion.certificates);
        let rest = self.rest(motion, &motion.motion, progress);
        let found = self.live.certify(&rest, &mut certificates).err();
        motion.certificates = certificates;
        motion.is_blocked = found.is_some();
        if let Some(in_the_way) = found
            && !self.goes_on(motion, in_the_way, progress)
        {
            motion.request_stop(in_the_way.into());
        }
    }

    /// Whether a motion that is not certified goes on: one that is replanned, or one to whose end a ball comes, while a later stop is certified;
    /// the latter also where a ball would come to where it is stopped now.
    fn goes_on(&self, motion: &SupervisedMotion, in_the_way: InTheWay, progress: Progress) -> bool {
        let is_patient = motion.is_replanned || in_the_way == InTheWay::AtTheEnd;
        (is_patient && self.has_a_later_stop(motion, progress))
            || (in_the_way == InTheWay::AtTheEnd
                && !self.stands_clear_after_a_stop(motion, progress, 0.0))
    }

    fn rest<'a>(
        &'a self,
        motion: &SupervisedMotion,
        part: &'a Trajectory,
        progress: Progress,
    ) -> RemainingMotion<'a> {
        RemainingMotion {
            padded: &self.rules.padded,
            motion: part,
            progress,
            stopping_s: motion.stopping_s,
            lag_allowance_s: 0.0,
        }
    }

    /// Whether a motion is certified until it would stand if supervision ended in the next round, and would stay clear of what moves where it
    /// stands after a stop that is ordered then.
    fn has_a_later_stop(&self, motion: &SupervisedMotion, progress: Progress) -> bool {
        let until_s = progress.passed_s() + NEXT_ROUND_S + UNSUPERVISED_S + motion.stopping_s;
        let Some(first_part) = until(&motion.motion, until_s) else {
            return false;
        };
        let rest = self.rest(motion, &first_part, progress);
        self.live
            .certify(&rest, &mut Certificates::default())
            .is_ok()
            && self.stands_clear_after_a_stop(motion, progress, NEXT_ROUND_S)
    }

    /// Whether the robot would stay clear of what moves where it stands after a stop that is ordered so many seconds from now.
    fn stands_clear_after_a_stop(
        &self,
        motion: &SupervisedMotion,
        progress: Progress,
        until_order_s: f64,
    ) -> bool {
        let until_order_s = seconds(self.now_mono_ns - progress.mono_ns) + until_order_s;
        let place_s = stop_place_s(
            &motion.motion,
            progress,
            until_order_s,
            &self.rules.rate_law,
        );
        let place = motion.motion.at(place_s).position;
        let padded = &self.rules.padded;
        self.live.stands_clear(padded, &place, self.now_mono_ns)
    }
}

/// The motion until the first knot at or after a time, s; none where it is over before that.
fn until(motion: &Trajectory, until_s: f64) -> Option<Trajectory> {
    let knots = motion.knots();
    let last = knots.partition_point(|knot| knot.time < until_s);
    let first: &[Knot] = knots.get(..=last)?;
    Trajectory::new(first.to_vec()).ok()
}

/// Path time, s, at which a motion stands after a stop that is ordered so many seconds after its state was told, if it keeps its rate until
/// then.
fn stop_place_s(
    motion: &Trajectory,
    progress: Progress,
    until_order_s: f64,
    rate_law: &RateLaw,
) -> f64 {
    let Progress { mut rate, .. } = progress;
    let mut time = (progress.time_s + (until_order_s + ORDER_DELAY_S) * rate).max(0.0);
    let mut hint = 0;
    while rate > 0.0 && time < motion.duration() {
        let playback = Playback {
            knots: motion.knots(),
            time,
            rate,
        };
        let step = rate_law.step(&playback, &mut hint, 0.0, CYCLE_S);
        (time, rate) = (time + step.advance, step.rate);
    }
    time.min(motion.duration())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{motion, unit_robot};

    #[test]
    fn a_slowed_motion_stands_nearer_than_one_at_full_rate_and_a_paused_one_where_it_is() {
        let motion = motion();
        let time_s = 0.4 * motion.duration();
        let rate_law = RateLaw::new(&unit_robot().tendons, 2.0);
        let place_s = |rate: f64, until_order_s: f64| {
            let progress = Progress {
                time_s,
                mono_ns: 0,
                rate,
            };
            stop_place_s(&motion, progress, until_order_s, &rate_law)
        };
        assert_eq!(place_s(0.0, NEXT_ROUND_S), time_s);
        let slow_s = place_s(0.1, NEXT_ROUND_S);
        assert!((time_s + 0.1 * (NEXT_ROUND_S + ORDER_DELAY_S)..time_s + 0.02).contains(&slow_s));
        let full_s = place_s(1.0, NEXT_ROUND_S);
        assert!(full_s > time_s + NEXT_ROUND_S + ORDER_DELAY_S && full_s < motion.duration());
        assert!(place_s(1.0, 0.0) < full_s);
    }
}
