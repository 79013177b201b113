//! Where a target that moves will be.

use std::collections::VecDeque;

use pcc_model::Point;
use shared_types::clock::seconds;

/// How far back a target is remembered, nanoseconds.
const REMEMBERED_NS: i64 = 600_000_000;
/// Least time between two places that are remembered, nanoseconds.
const BETWEEN_NS: i64 = 8_000_000;
/// Time over which a target's turn is measured, nanoseconds.
const TURN_NS: i64 = 200_000_000;
/// Time ahead for which both ways to foresee a target are judged, nanoseconds.
const JUDGED_NS: i64 = 400_000_000;
/// Share of a new judgement in the mean of all.
const JUDGEMENT_SHARE: f64 = 0.05;
/// Most that a target is foreseen to turn, rad.
const MOST_TURN_RAD: f64 = 1.5;

/// A target as it was told of once, m, m/s, m/s².
#[derive(Clone, Copy, Debug)]
struct Seen {
    stamp_mono_ns: i64,
    position: Point,
    velocity: Point,
    /// Acceleration across its way.
    turn: Point,
}

/// What is known of how a target moves: straight ahead, or on a circle where that has foreseen it better of late.
#[derive(Clone, Debug, Default)]
pub(super) struct TargetMotion {
    seen: VecDeque<Seen>,
    /// Mean squares of what straight and turning motion foresaw wrongly, m²; none before the first judgement.
    squares: Option<[f64; 2]>,
}

impl TargetMotion {
    /// Takes in where the target was, m, and how it moved, m/s. It is forgotten where it comes to rest.
    pub(super) fn see(&mut self, stamp_mono_ns: i64, position: Point, velocity: Point) {
        if velocity == Point::zeros() {
            *self = Self::default();
            return;
        }
        let since_ns = |seen: &Seen| stamp_mono_ns - seen.stamp_mono_ns;
        if self.seen.back().is_some_and(|it| since_ns(it) < BETWEEN_NS) {
            return;
        }
        while self
            .seen
            .front()
            .is_some_and(|it| since_ns(it) > REMEMBERED_NS)
        {
            self.seen.pop_front();
        }
        let before = |time_ns: i64| self.seen.iter().rev().find(|it| since_ns(it) >= time_ns);
        let turn = before(TURN_NS).map_or(Point::zeros(), |then| {
            let change = (velocity - then.velocity) / seconds(since_ns(then));
            change - velocity * (change.dot(&velocity) / velocity.norm_squared())
        });
        if let Some(then) = before(JUDGED_NS) {
            let time_s = seconds(since_ns(then));
            let wrong = [then.straight(time_s), then.turning(time_s)];
            let wrong = wrong.map(|foreseen| (foreseen - position).norm_squared());
            self.squares = Some(match self.squares {
                None => wrong,
                Some(mean) => std::array::from_fn(|way| {
                    mean[way] + JUDGEMENT_SHARE * (wrong[way] - mean[way])
                }),
            });
        }
        self.seen.push_back(Seen {
            stamp_mono_ns,
            position,
            velocity,
            turn,
        });
    }

    /// How far the target will be from where it was seen last after some more time, m.
    pub(super) fn way_after(&self, time_s: f64) -> Point {
        let Some(newest) = self.seen.back() else {
            return Point::zeros();
        };
        let turns = self
            .squares
            .is_some_and(|[straight, turning]| turning < straight);
        let there = if turns {
            newest.turning(time_s)
        } else {
            newest.straight(time_s)
        };
        there - newest.position
    }
}

impl Seen {
    fn straight(&self, time_s: f64) -> Point {
        self.position + time_s * self.velocity
    }

    /// On the circle of its velocity and turn, at constant speed.
    fn turning(&self, time_s: f64) -> Point {
        let (speed, bend) = (self.velocity.norm(), self.turn.norm());
        let rate = bend / speed;
        if rate * time_s < 1e-6 {
            return self.straight(time_s);
        }
        let angle = (rate * time_s).min(MOST_TURN_RAD);
        let sideways = self.turn * (speed / bend);
        self.position + (self.velocity * angle.sin() + sideways * (1.0 - angle.cos())) / rate
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BEGIN: i64 = 7_000_000_000;
    /// Time between two messages, nanoseconds.
    const EVERY: i64 = 10_000_000;

    /// What is known after so many seconds of a target that is where and as fast as `at` says.
    fn after(at: impl Fn(f64) -> (Point, Point), lasts_s: f64) -> TargetMotion {
        let mut motion = TargetMotion::default();
        for index in 0..(lasts_s * 100.0) as i64 {
            let (position, velocity) = at(seconds(index * EVERY));
            motion.see(BEGIN + index * EVERY, position, velocity);
        }
        motion
    }

    /// On a circle of 0.5 m with one radian a second.
    fn circle(time_s: f64) -> (Point, Point) {
        let (sine, cosine) = time_s.sin_cos();
        (
            0.5 * Point::new(cosine, sine, 0.0),
            0.5 * Point::new(-sine, cosine, 0.0),
        )
    }

    /// To and fro in a straight line, 0.2 s each way.
    fn to_and_fro(time_s: f64) -> (Point, Point) {
        let phase = time_s.rem_euclid(0.4);
        let (place, way) = if phase < 0.2 {
            (phase, 1.0)
        } else {
            (0.4 - phase, -1.0)
        };
        (Point::new(place, 0.0, 0.0), Point::new(way, 0.0, 0.0))
    }

    #[test]
    fn a_target_that_turns_is_foreseen_on_its_circle_once_that_was_seen_to_be_right() {
        let (_, velocity) = circle(0.29);
        let way = after(circle, 0.3).way_after(0.5);
        assert!(
            (way - 0.5 * velocity).norm() < 1e-9,
            "not judged yet: {way}"
        );
        let (now_s, ahead_s) = (1.99, 0.5);
        let way = after(circle, 2.0).way_after(ahead_s);
        let there = circle(now_s + ahead_s).0 - circle(now_s).0;
        assert!((way - there).norm() < 0.03, "{way} {there}");
        let tangent = ahead_s * circle(now_s).1;
        assert!((tangent - there).norm() > 0.05);
    }

    #[test]
    fn what_goes_straight_or_to_and_fro_is_foreseen_straight_ahead() {
        let velocity = Point::new(0.1, -0.2, 0.3);
        let way = after(|time_s| (time_s * velocity, velocity), 2.0).way_after(0.7);
        assert!((way - 0.7 * velocity).norm() < 1e-9);
        let way = after(to_and_fro, 2.0).way_after(0.1);
        assert!((way.norm() - 0.1).abs() < 1e-9);
    }

    #[test]
    fn nothing_is_foreseen_of_a_target_that_rests() {
        let mut motion = after(circle, 1.0);
        motion.see(BEGIN + 100 * EVERY, Point::zeros(), Point::zeros());
        assert_eq!(motion.way_after(1.0), Point::zeros());
    }
}
