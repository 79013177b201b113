//! A ball that crosses the way of a motion behind the robot's tip.

use pcc_model::{Point, Robot};
use tests::brute_force::{Ball, Body};
use trajectory::Trajectory;

use super::scenario::SECOND_NS;

const RADIUS_M: f64 = 0.1;
/// Clearance of a motion that lags as much as it is meant to be able to, m.
const SPARE_M: f64 = 0.02;

/// A motion, and a ball that crosses its way when the tip has passed.
pub(super) struct Crossing {
    pub(super) motion: Trajectory,
    /// When the tip is at the crossing, s of the motion.
    pub(super) tip_s: f64,
    /// When the ball is, s of the motion if that does not lag.
    pub(super) ball_s: f64,
    /// From this time of the motion on it lags, s.
    lags_from_s: f64,
    place: Point,
    velocity: Point,
}

impl Crossing {
    /// The ball comes across the plane of the tip's way, as soon after the tip as leaves room for every lag up to `room_s`; it is
    /// `before_s` before the tip is there that the motion begins to lag.
    pub(super) fn new(
        (robot, body): (&Robot, &Body),
        motion: Trajectory,
        speed_m_s: f64,
        room_s: f64,
        before_s: f64,
    ) -> anyhow::Result<Self> {
        let tip_s = 0.5 * motion.duration();
        let tip = |time| robot.tip(&motion.at(time).position);
        let (place, onward) = (tip(tip_s), tip(tip_s + 0.05) - tip(tip_s));
        let velocity = onward.cross(&place).normalize() * speed_m_s;
        let mut crossing = Self {
            motion,
            tip_s,
            ball_s: tip_s,
            lags_from_s: tip_s - before_s,
            place,
            velocity,
        };
        for step in 0..300 {
            crossing.ball_s = tip_s + 0.02 * f64::from(step);
            let mut lags = (0..=20).map(|i| room_s * f64::from(i) / 20.0);
            let clear = |lag_s| crossing.clearance(body, lag_s) > SPARE_M;
            if lags.all(clear) {
                return Ok(crossing);
            }
        }
        anyhow::bail!("no time at which the ball could cross");
    }

    /// The ball of a motion that begins at this time.
    pub(super) fn ball(&self, begin_ns: i64) -> Ball {
        Ball {
            centre_m: self.place.into(),
            radius_m: RADIUS_M,
            velocity_m_s: self.velocity.into(),
            stamp_ns: begin_ns + (self.ball_s * SECOND_NS as f64) as i64,
        }
    }

    /// When the ball is beyond everything that the robot can reach, s of the motion: it goes at right angles to the line from the base
    /// to the crossing.
    pub(super) fn past_s(&self, robot: &Robot) -> f64 {
        let length: f64 = robot.section_lengths.iter().sum();
        let reach = length + robot.largest_tube_radius() + RADIUS_M;
        let way = (reach.powi(2) - self.place.norm_squared()).max(0.0).sqrt();
        self.ball_s + way / self.velocity.norm()
    }

    /// Clearance of the motion if it lags by this much, seen fifty times a second.
    pub(super) fn clearance(&self, body: &Body, lag_s: f64) -> f64 {
        let ball = [self.ball(0)];
        let clearance = |i: i32| {
            let time_s = 0.02 * f64::from(i);
            let late_s = time_s
                + if time_s > self.lags_from_s {
                    lag_s
                } else {
                    0.0
                };
            let shape = self.motion.at(time_s).position.into();
            body.clearance(&shape, &ball, (late_s * SECOND_NS as f64) as i64)
        };
        let count = (self.motion.duration() * 50.0) as i32;
        (0..=count).map(clearance).fold(f64::INFINITY, f64::min)
    }
}
