//! The pieces of a motion that are left from a time on.

use crate::certify::bisection::Piece;
use trajectory::Knot;

/// The pieces of a motion that are left from a time on; at least one, be it of no duration.
pub(crate) struct RemainingPieces<'a> {
    knots: &'a [Knot],
    from_time: f64,
}

impl<'a> RemainingPieces<'a> {
    pub(crate) fn new(knots: &'a [Knot], from_time: f64) -> Self {
        let passed = knots.partition_point(|k| k.time <= from_time);
        let first = passed.saturating_sub(1).min(knots.len() - 2);
        Self {
            knots: &knots[first..],
            from_time: from_time.max(0.0),
        }
    }

    pub(crate) fn count(&self) -> usize {
        self.knots.len() - 1
    }

    /// Pieces that begin before a time, at least one.
    pub(crate) fn count_until(&self, time: f64) -> usize {
        let begun = self.knots.partition_point(|knot| knot.time < time);
        begun.clamp(1, self.count())
    }

    pub(crate) fn piece(&self, index: usize) -> Piece {
        let piece = Piece::between(&self.knots[index], &self.knots[index + 1]);
        if index == 0 {
            piece.remaining(self.from_time)
        } else {
            piece
        }
    }
}
