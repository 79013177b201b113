//! The obstacles that there are now, and whether a motion keeps clear of them.

use collision::{Ball, MovingBall, Scene, Verdict, certify_moving, certify_trajectory};
use pcc_model::{Point, Robot};
use shared_types::{message, valid};
use trajectory::Trajectory;

/// Slowest rate of a motion that the positions of moving balls are computed for.
const LEAST_RATE: f64 = 0.05;

/// When a motion is where on its path, if its rate stays the same.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Timing {
    /// Clock time at which the motion's own time is zero, nanoseconds of `CLOCK_MONOTONIC`.
    pub(crate) zero_mono_ns: i64,
    /// Seconds of the motion's own time a second of the clock, 0..=1.
    pub(crate) rate: f64,
}

impl Timing {
    /// A motion that runs at full rate from `begin_mono_ns`.
    pub(crate) fn from_begin(begin_mono_ns: i64) -> Self {
        Self {
            zero_mono_ns: begin_mono_ns,
            rate: 1.0,
        }
    }

    /// A motion that is at `time_s` of its own time now.
    pub(crate) fn passing(time_s: f64, now_mono_ns: i64, rate: f64) -> Self {
        let rate = rate.max(LEAST_RATE);
        Self {
            zero_mono_ns: now_mono_ns - (time_s / rate * 1e9) as i64,
            rate,
        }
    }
}

/// Resting and moving balls, in the planner's units (lengths in sections).
#[derive(Debug, Default)]
pub(crate) struct LiveScene {
    received: Option<valid::Scene>,
    resting: Scene,
    /// At the stamp of the message they came with.
    moving: Vec<MovingBall>,
    changes: u64,
}

impl LiveScene {
    /// Replaces the scene by a validated message's.
    pub(crate) fn replace(&mut self, received: valid::Scene, section_length_m: f64) {
        let is_resting = |ball: &message::MovingBall| ball.velocity_m_s == [0.0; 3];
        let same = |old: &valid::Scene| {
            old.balls == received.balls && received.balls.iter().all(is_resting)
        };
        if self.received.as_ref().is_some_and(same) {
            return;
        }
        let balls = |resting: bool| {
            let balls = received.balls.iter();
            balls.filter(move |ball| is_resting(ball) == resting)
        };
        let resting = balls(true).map(|ball| moving_ball(ball, section_length_m).ball);
        self.resting = match Scene::new(resting.collect()) {
            Ok(resting) => resting,
            Err(error) => {
                return tracing::warn!("a scene is refused, the one before stays: {error}");
            }
        };
        self.moving = balls(false)
            .map(|ball| moving_ball(ball, section_length_m))
            .collect();
        self.received = Some(received);
        self.changes += 1;
    }

    /// How often the scene changed; equal numbers mean equal scenes.
    pub(crate) fn changes(&self) -> u64 {
        self.changes
    }

    /// Certifies a motion of a grown robot from `from_time_s` of its own time on.
    pub(crate) fn certify(
        &self,
        grown: &Robot,
        motion: &Trajectory,
        from_time_s: f64,
        timing: Timing,
    ) -> Verdict {
        let resting = certify_trajectory(grown, &self.resting, motion, from_time_s);
        if !resting.is_free() || self.moving.is_empty() {
            return resting;
        }
        let balls = self.moving_at(timing);
        certify_moving(grown, &balls, motion, from_time_s)
    }

    /// The moving balls in the motion's own time: where they are at its zero, and how fast they pass.
    fn moving_at(&self, timing: Timing) -> Vec<MovingBall> {
        let stamp_mono_ns = self
            .received
            .as_ref()
            .map_or(0, |scene| scene.stamp_mono_ns);
        let age_s = (timing.zero_mono_ns - stamp_mono_ns) as f64 * 1e-9;
        let at_zero = |moving: &MovingBall| MovingBall {
            ball: Ball {
                centre: moving.ball.centre + moving.velocity * age_s,
                radius: moving.ball.radius,
            },
            velocity: moving.velocity / timing.rate,
        };
        self.moving.iter().map(at_zero).collect()
    }
}

fn moving_ball(ball: &message::MovingBall, section_length_m: f64) -> MovingBall {
    MovingBall {
        ball: Ball {
            centre: Point::from(ball.centre_m) / section_length_m,
            radius: ball.radius_m / section_length_m,
        },
        velocity: Point::from(ball.velocity_m_s) / section_length_m,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{motion, unit_robot};

    const LENGTH_M: f64 = 0.5;

    fn scene(stamp_mono_ns: i64, balls: &[([f64; 3], [f64; 3])]) -> valid::Scene {
        let ball = |&(centre_m, velocity_m_s): &([f64; 3], [f64; 3])| message::MovingBall {
            centre_m,
            radius_m: 0.1,
            velocity_m_s,
        };
        valid::Scene {
            stamp_mono_ns,
            balls: balls.iter().map(ball).collect(),
        }
    }

    fn verdict(live: &LiveScene, begin_mono_ns: i64) -> Verdict {
        let timing = Timing::from_begin(begin_mono_ns);
        let grown = unit_robot().with_tube_growth(&[0.0025, 0.01, 0.0225]);
        live.certify(&grown, &motion(), 0.0, timing)
    }

    #[test]
    fn a_ball_in_the_way_is_seen_and_one_aside_is_not() {
        let mut live = LiveScene::default();
        assert!(verdict(&live, 0).is_free());
        live.replace(scene(0, &[([0.0, 0.0, 0.75], [0.0; 3])]), LENGTH_M);
        assert!(!verdict(&live, 0).is_free());
        live.replace(scene(0, &[([2.0, 0.0, 0.75], [0.0; 3])]), LENGTH_M);
        assert!(verdict(&live, 0).is_free());
    }

    #[test]
    fn a_moving_ball_counts_where_it_is_at_the_begin() {
        let mut live = LiveScene::default();
        // 5 m away and coming at 1 m/s: far away for a motion of some seconds that begins now, through the body for one
        // that begins when it arrives.
        assert!(motion().duration() < 4.0);
        live.replace(scene(0, &[([5.0, 0.0, 0.75], [-1.0, 0.0, 0.0])]), LENGTH_M);
        assert!(verdict(&live, 0).is_free());
        assert!(!verdict(&live, 5_000_000_000).is_free());
        assert!(verdict(&live, 60_000_000_000).is_free(), "long gone");
    }

    #[test]
    fn a_slow_motion_meets_a_ball_that_a_fast_one_leaves_behind() {
        let mut live = LiveScene::default();
        live.replace(scene(0, &[([5.0, 0.0, 0.75], [-1.0, 0.0, 0.0])]), LENGTH_M);
        let duration = motion().duration();
        let timing = Timing::passing(0.5 * duration, 0, 0.1);
        let certify = |timing| {
            let (robot, motion) = (unit_robot(), motion());
            live.certify(&robot, &motion, 0.5 * duration, timing)
        };
        assert!(!certify(timing).is_free());
        assert!(certify(Timing::passing(0.5 * duration, 0, 1.0)).is_free());
    }

    #[test]
    fn the_same_resting_scene_again_is_no_change() {
        let mut live = LiveScene::default();
        let resting = [([0.0, 0.0, 0.75], [0.0; 3])];
        live.replace(scene(1, &resting), LENGTH_M);
        live.replace(scene(2, &resting), LENGTH_M);
        assert_eq!(live.changes(), 1);
        live.replace(scene(3, &[]), LENGTH_M);
        assert_eq!(live.changes(), 2);
        let moving = [([9.0, 0.0, 0.75], [0.1, 0.0, 0.0])];
        live.replace(scene(4, &moving), LENGTH_M);
        live.replace(scene(5, &moving), LENGTH_M);
        assert_eq!(live.changes(), 4, "the same numbers at another time");
    }
}
