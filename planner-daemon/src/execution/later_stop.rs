//! Whether a motion that is not certified to its end may go on for another round: while a later stop is certified, too, another plan can be
//! joined in time.

use trajectory::{Knot, Playback, Trajectory};

use super::rules::{ExecutionRules, ORDER_DELAY_S};
use super::supervised_motion::SupervisedMotion;
use crate::live_scene::{
    Certificates, InTheWay, LiveScene, RemainingMotion, Timing, UNSUPERVISED_S,
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
    /// Certifies what is left of a motion from a path time (s) on, and requests a stop where that fails, unless the motion goes on for another
    /// round.
    pub(super) fn check(&self, motion: &mut SupervisedMotion, from_s: f64, timing: Timing) {
        let mut certificates = std::mem::take(&mut motion.certificates);
        let rest = self.rest(motion, &motion.motion, from_s, timing);
        let found = self.live.certify(&rest, &mut certificates).err();
        motion.certificates = certificates;
        motion.is_blocked = found.is_some();
        if let Some(in_the_way) = found
            && !self.goes_on(motion, in_the_way, from_s, timing)
        {
            motion.request_stop(in_the_way.into());
        }
    }

    /// Whether a motion that is not certified goes on: one that is replanned, or one to whose end a ball comes, while a later stop is certified;
    /// the latter also where a ball would come to where it is stopped now.
    fn goes_on(
        &self,
        motion: &SupervisedMotion,
        in_the_way: InTheWay,
        from_s: f64,
        timing: Timing,
    ) -> bool {
        let is_patient = motion.is_replanned || in_the_way == InTheWay::AtTheEnd;
        (is_patient && self.has_a_later_stop(motion, from_s, timing))
            || (in_the_way == InTheWay::AtTheEnd && !self.stands_clear_after_a_stop(motion, from_s))
    }

    fn rest<'a>(
        &'a self,
        motion: &SupervisedMotion,
        part: &'a Trajectory,
        from_s: f64,
        timing: Timing,
    ) -> RemainingMotion<'a> {
        RemainingMotion {
            padded: &self.rules.padded,
            motion: part,
            from_s,
            timing,
            at_full_rate: motion.at_full_rate(),
            stopping_s: motion.stopping_s,
            lag_allowance_s: 0.0,
        }
    }

    /// Whether a motion at this path time, s, is certified until it would stand if supervision ended in the next round, and would stay clear
    /// of what moves where it stands after a stop that is ordered then.
    fn has_a_later_stop(&self, motion: &SupervisedMotion, from_s: f64, timing: Timing) -> bool {
        let until_s = from_s + NEXT_ROUND_S + UNSUPERVISED_S + motion.stopping_s;
        let Some(first_part) = until(&motion.motion, until_s) else {
            return false;
        };
        let rest = self.rest(motion, &first_part, from_s, timing);
        self.live
            .certify(&rest, &mut Certificates::default())
            .is_ok()
            && self.stands_clear_after_a_stop(motion, from_s + NEXT_ROUND_S)
    }

    /// Whether the robot would stay clear of what moves where it stands after a stop that is ordered at this path time, s.
    fn stands_clear_after_a_stop(&self, motion: &SupervisedMotion, ordered_s: f64) -> bool {
        let place_s = stop_place_s(&motion.motion, ordered_s, self.rules);
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

/// Path time at which a stop ends that is ordered at this one, at full rate, s.
fn stop_place_s(motion: &Trajectory, ordered_s: f64, rules: &ExecutionRules) -> f64 {
    let (mut time, mut rate, mut hint) = (ordered_s + ORDER_DELAY_S, 1.0, 0);
    while rate > 0.0 && time < motion.duration() {
        let playback = Playback {
            knots: motion.knots(),
            time,
            rate,
        };
        let step = rules.rate_law.step(&playback, &mut hint, 0.0, CYCLE_S);
        (time, rate) = (time + step.advance, step.rate);
    }
    time.min(motion.duration())
}
