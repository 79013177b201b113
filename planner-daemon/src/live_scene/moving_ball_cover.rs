//! The safety cover of moving balls between two certificates: everywhere that they can be, however late the robot comes.
//!
//! A scene is believed until its lifetime is over; what moves then is stopped, unless supervision dies just before: then it goes on
//! for some time more. Let L be the lifetime, that time and the time of a stop together. Until then a ball that was at c at the stamp s
//! and moves at v is at the clock time t at c + v (t − s), or anywhere on its way since the stamp if it has slowed down or stopped. A
//! motion that was expected at path time p at the clock time t(p) is there at t(p) + lag.
//! So at path time p each ball is taken to be everywhere between t(p) − L and t(p) + L: all that can be true until the robot is at
//! rest, whatever the lag up to L, is in there. Both ends are wider by [`TOLERANCE_S`], within which t(p) may change without a new
//! certificate. That piece of its way is covered by balls that move along with it.

use collision::{MovingBall, TimeSpread};

/// Slowest rate of a motion that the positions of moving balls are computed for.
const MIN_RATE: f64 = 0.05;
/// Change of the clock time at which a motion is at a place of its path, within which its certificate holds, s.
pub(crate) const TOLERANCE_S: f64 = 0.01;
/// From the last heartbeat until the controller misses it, nanoseconds: `daemon_lost_ms` as shipped.
pub(crate) const HEARTBEAT_TIMEOUT_NS: i64 = 200_000_000;
/// Longest time that a motion goes on when supervision is held or dies, or nobody answers its order to stop, s: until the order counts
/// as ignored (0.04), the heart stops (0.1) and the controller misses it (0.2), and some rounds of each (0.01).
pub(crate) const UNSUPERVISED_S: f64 = 0.35;

/// Timing of a motion along its path at a constant rate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Timing {
    /// Clock time at which the motion's own time is zero, nanoseconds of `CLOCK_MONOTONIC`.
    zero_mono_ns: i64,
    /// Seconds of the motion's own time a second of the clock, above 0 to 1.
    rate: f64,
}

impl Timing {
    /// A motion that runs at full rate from `begin_mono_ns`.
    pub(crate) fn from_begin(begin_mono_ns: i64) -> Self {
        Self {
            zero_mono_ns: begin_mono_ns,
            rate: 1.0,
        }
    }

    /// The clock time so many seconds after the motion's time zero, nanoseconds of `CLOCK_MONOTONIC`.
    pub(crate) fn delayed(self, delay_s: f64) -> i64 {
        self.zero_mono_ns.saturating_add((delay_s * 1e9) as i64)
    }

    /// A motion that is at `time_s` of its own time at a clock time.
    pub(crate) fn passing(time_s: f64, mono_ns: i64, rate: f64) -> Self {
        let rate = rate.clamp(MIN_RATE, 1.0);
        Self {
            zero_mono_ns: mono_ns.saturating_sub((time_s / rate * 1e9) as i64),
            rate,
        }
    }

    /// Whether a motion that keeps this other timing is at both path times, and so between them, within the tolerance of when this
    /// one says.
    pub(crate) fn is_near(self, other: Self, path_times_s: [f64; 2]) -> bool {
        let zero_s = (self.zero_mono_ns - other.zero_mono_ns) as f64 * 1e-9;
        let slower = 1.0 / self.rate - 1.0 / other.rate;
        let shift = |time_s: f64| (zero_s + time_s * slower).abs();
        path_times_s.iter().all(|time| shift(*time) <= TOLERANCE_S)
    }
}

/// The path from the motion's present place to a later one, with its timing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Stretch {
    pub(crate) timing: Timing,
    /// Path time at the stretch's end, s.
    pub(crate) until_s: f64,
}

/// The cover of a scene's moving balls: the times for which every place that they can reach is covered.
pub(crate) struct MovingBallCover {
    pub(crate) timing: Timing,
    pub(crate) stamp_mono_ns: i64,
    pub(crate) lifetime_s: f64,
    /// Time from the end of a scene's lifetime until the robot is at rest, s.
    pub(crate) stopping_s: f64,
    /// How much later than the lifetime allows the robot must be able to come, s.
    pub(crate) lag_allowance_s: f64,
}

impl MovingBallCover {
    /// Age of the scene when the motion's own time is zero, s.
    fn age_s(&self) -> f64 {
        (self.timing.zero_mono_ns - self.stamp_mono_ns) as f64 * 1e-9
    }

    /// The balls where they are when the motion's own time is zero, with their velocities by that time.
    pub(crate) fn by_path_time(&self, balls: &[MovingBall]) -> Vec<MovingBall> {
        let age_s = self.age_s();
        let by_path_time = |moving: &MovingBall| MovingBall {
            ball: moving.at(age_s),
            velocity: moving.velocity / self.timing.rate,
        };
        balls.iter().map(by_path_time).collect()
    }

    /// By how much the balls may be behind or ahead, in the motion's own time.
    pub(crate) fn spread(&self) -> TimeSpread {
        let either_side_s = self.lifetime_s + UNSUPERVISED_S + self.stopping_s + TOLERANCE_S;
        TimeSpread {
            earliest: -either_side_s * self.timing.rate,
            latest: (either_side_s + self.lag_allowance_s) * self.timing.rate,
            seen: -self.age_s() * self.timing.rate,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::unit_robot;
    use collision::{Ball, Cover};
    use pcc_model::Point;

    const SECOND: i64 = 1_000_000_000;

    fn cover(lifetime_s: f64) -> MovingBallCover {
        MovingBallCover {
            timing: Timing::from_begin(2 * SECOND),
            stamp_mono_ns: SECOND,
            lifetime_s: 0.5 * lifetime_s,
            stopping_s: 0.5 * lifetime_s,
            lag_allowance_s: 0.2,
        }
    }

    fn covers(cover: &MovingBallCover, ball: MovingBall, times: [f64; 2]) -> Vec<Vec<MovingBall>> {
        let (balls, robot) = (cover.by_path_time(&[ball]), unit_robot());
        let spread = cover.spread();
        let covers = Cover::ALL.into_iter();
        covers
            .filter_map(|kind| spread.cover(kind, &balls, &robot, times))
            .collect()
    }

    fn moving(speed: f64, radius: f64) -> MovingBall {
        MovingBall {
            ball: Ball {
                centre: Point::new(1.0, 0.0, 1.0),
                radius,
            },
            velocity: Point::new(0.0, speed, 0.0),
        }
    }

    #[test]
    fn all_places_within_the_lifetime_and_the_robots_reach_are_covered() {
        for (speed, radius) in [
            (0.1, 0.3),
            (0.5, 0.1),
            (2.0, 0.05),
            (-1.0, 0.0),
            (30.0, 0.1),
        ] {
            let (ball, cover) = (moving(speed, radius), cover(0.3));
            let covers = covers(&cover, ball, [0.0, 0.7]);
            assert_eq!(covers.len(), 2);
            for path_s in [0.0, 0.7] {
                for step in 0..=100 {
                    // From a lifetime, an unsupervised time and a stop before to as much and the allowance after the time at which the
                    // motion is there.
                    let off_s = -0.65 + 1.5 * f64::from(step) / 100.0;
                    let true_ball = ball.at(1.0 + path_s + off_s);
                    for tilt in 0..8 {
                        let angle = f64::from(tilt) * std::f64::consts::FRAC_PI_4;
                        let side = Point::new(angle.cos(), angle.sin(), 0.0) * radius;
                        let surface = true_ball.centre + side;
                        let inside = |other: &MovingBall| {
                            let other = other.at(path_s);
                            (surface - other.centre).norm() <= other.radius + 1e-12
                        };
                        let is_covered = covers.iter().all(|set| set.iter().any(inside));
                        let is_reached = surface.norm() < 3.0;
                        assert!(is_covered || !is_reached, "{speed} {radius} {off_s}");
                    }
                }
            }
        }
    }

    #[test]
    fn balls_out_of_reach_are_left_out() {
        let count = |centre: Point, velocity: Point| {
            let ball = MovingBall {
                ball: Ball {
                    centre,
                    radius: 0.2,
                },
                velocity,
            };
            let covers = covers(&cover(0.1), ball, [0.0, 3.0]);
            covers.iter().map(Vec::len).max().unwrap()
        };
        assert_eq!(
            count(Point::new(9.0, 0.0, 0.0), Point::new(-0.1, 0.0, 0.0)),
            0
        );
        assert!(count(Point::new(9.0, 0.0, 0.0), Point::new(-2.0, 0.0, 0.0)) > 0);
        assert!(count(Point::new(2.0, 0.0, 0.0), Point::new(0.1, 0.0, 0.0)) > 0);
        assert!(count(Point::repeat(f64::NAN), Point::new(0.1, 0.0, 0.0)) > 0);
    }

    #[test]
    fn a_lag_and_another_rate_ask_for_a_new_certificate() {
        let timing = Timing::passing(1.0, 5 * SECOND, 1.0);
        let near = |other| timing.is_near(other, [1.0, 3.0]);
        assert!(near(Timing::passing(1.5, 5_500_000_000, 1.0)));
        assert!(near(Timing::passing(1.0, 5_009_000_000, 1.0)));
        assert!(!near(Timing::passing(1.0, 5_011_000_000, 1.0)));
        assert!(!near(Timing::passing(1.0, 5 * SECOND, 0.99)));
        assert!(near(Timing::passing(1.0, 5 * SECOND, 0.996)));
    }
}
