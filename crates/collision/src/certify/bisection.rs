//! The certificate for a chain of curves: bisection in time.
//!
//! Where the clearances at the ends of an interval and the bounds on the body's motion between them ([`MotionBound`]) leave room
//! for contact, the interval is halved, to a depth, and only the sections that may touch are measured further; what stays
//! undecided counts as colliding. Nothing here allocates.

use crate::certify::motion_bound::MotionBound;
use crate::certify::obstacles::{Obstacles, may_touch, touches};
use crate::certify::verdict::{DEPTH, Verdict};
use crate::distance::chosen_sections::{Chosen, EVERY_SECTION, NO_SECTION};
use pcc_model::{Configuration, Robot};
use trajectory::{Knot, QuinticSegment};

/// Pieces whose bounds are kept at once, on the stack.
const BLOCK: usize = 48;

/// A curve and the time at which it begins.
pub(crate) struct Piece {
    pub(crate) begin: f64,
    pub(crate) curve: QuinticSegment,
}

impl Piece {
    pub(crate) fn between(from: &Knot, to: &Knot) -> Self {
        Self {
            begin: from.time,
            curve: QuinticSegment::between(from, to),
        }
    }

    /// A straight edge from time `begin` on, passed in unit time.
    pub(crate) fn edge(from: &Configuration, to: &Configuration, begin: f64) -> Self {
        let step = (to - from) * 0.2;
        let duration = 1.0;
        let control = [
            *from,
            from + step,
            from + step * 2.0,
            to - step * 2.0,
            to - step,
            *to,
        ];
        Self {
            begin,
            curve: QuinticSegment { duration, control },
        }
    }

    /// The part of the piece from `time` on, which is clamped to the piece (de Casteljau).
    pub(crate) fn remaining(&self, time: f64) -> Self {
        let passed = (time - self.begin).clamp(0.0, self.curve.duration);
        let fraction = passed / self.curve.duration;
        let mut control = self.curve.control;
        for last in (0..control.len() - 1).rev() {
            for i in 0..=last {
                control[i] = control[i].lerp(&control[i + 1], fraction);
            }
        }
        let duration = self.curve.duration - passed;
        Self {
            begin: self.begin + passed,
            curve: QuinticSegment { duration, control },
        }
    }

    pub(crate) fn halves(&self) -> (Self, Self) {
        let (first, second) = self.curve.halves();
        let middle = self.begin + first.duration;
        let part = |begin, curve| Self { begin, curve };
        (part(self.begin, first), part(middle, second))
    }

    pub(crate) fn start(&self) -> &Configuration {
        &self.curve.control[0]
    }

    pub(crate) fn end(&self) -> f64 {
        self.begin + self.curve.duration
    }
}

/// Certifies pieces that follow each other.
pub(crate) struct Certifier<'a, O> {
    pub(crate) robot: &'a Robot,
    pub(crate) obstacles: O,
    /// Whether there may be corners where pieces meet.
    pub(crate) has_corners: bool,
}

impl<O: Obstacles> Certifier<'_, O> {
    /// Certifies the pieces 0 to `count` − 1 given by `piece`, each beginning where the one before it ends.
    pub(crate) fn chain(&self, count: usize, piece: &impl Fn(usize) -> Piece) -> Verdict {
        let start = piece(0);
        let mut from = self.state(start.start(), start.begin, &EVERY_SECTION);
        if touches::<O>(&from) {
            return Verdict::Colliding { at: start.begin };
        }
        for first in (0..count).step_by(BLOCK) {
            let mut bounds = [MotionBound::REST; BLOCK];
            let length = BLOCK.min(count - first);
            for (i, bound) in bounds[..length].iter_mut().enumerate() {
                *bound = MotionBound::of_curve(&piece(first + i).curve);
            }
            let last = piece(first + length - 1);
            let to = self.state(&last.curve.control[5], last.end(), &EVERY_SECTION);
            if touches::<O>(&to) {
                return Verdict::Colliding { at: last.end() };
            }
            let verdict = self.pieces(piece, first, &bounds[..length], [&from, &to]);
            if !verdict.is_free() {
                return verdict;
            }
            from = to;
        }
        Verdict::Free
    }

    fn state(&self, configuration: &Configuration, time: f64, chosen: &Chosen) -> O::State {
        self.obstacles
            .state(self.robot, configuration, time, chosen)
    }

    /// Certifies the pieces from index `first` on that have these bounds, between the states at their two ends.
    fn pieces(
        &self,
        piece: &impl Fn(usize) -> Piece,
        first: usize,
        bounds: &[MotionBound],
        [from, to]: [&O::State; 2],
    ) -> Verdict {
        if let [bound] = bounds {
            return self.piece(&piece(first), bound, [from, to], DEPTH);
        }
        let mut bound = MotionBound::of_successive(bounds);
        if self.has_corners {
            bound = bound.with_corner();
        }
        let open = may_touch(self.obstacles.lowest(from, to, self.robot, &bound));
        if open == NO_SECTION {
            return Verdict::Free;
        }
        let (earlier, later) = bounds.split_at(bounds.len() / 2);
        let second = first + earlier.len();
        let middle = piece(second);
        let between = self.state(middle.start(), middle.begin, &open);
        if touches::<O>(&between) {
            return Verdict::Colliding { at: middle.begin };
        }
        match self.pieces(piece, first, earlier, [from, &between]) {
            Verdict::Free => self.pieces(piece, second, later, [&between, to]),
            found => found,
        }
    }

    /// Certifies one piece, between its states at both ends, with at most `depth` bisections.
    fn piece(
        &self,
        piece: &Piece,
        bound: &MotionBound,
        [from, to]: [&O::State; 2],
        depth: u32,
    ) -> Verdict {
        let open = may_touch(self.obstacles.lowest(from, to, self.robot, bound));
        if open == NO_SECTION {
            return Verdict::Free;
        }
        let (first, second) = piece.halves();
        let at = second.begin;
        if depth == 0 {
            return Verdict::Undecided { at };
        }
        let between = self.state(second.start(), at, &open);
        if touches::<O>(&between) {
            return Verdict::Colliding { at };
        }
        let [earlier, later] = [&first, &second].map(|half| MotionBound::of_curve(&half.curve));
        match self.piece(&first, &earlier, [from, &between], depth - 1) {
            Verdict::Free => self.piece(&second, &later, [&between, to], depth - 1),
            found => found,
        }
    }
}
