//! The newest accepted scene of a source in the planner's units, and its certification.

use std::sync::Arc;

use collision::{
    Ball, Cover, MovingBall, Scene, SceneError, Verdict, certify_moving, certify_trajectory,
};
use pcc_model::{Configuration, Point, SECTIONS, UnitRobot};
use shared_types::message;
use shared_types::valid;

use super::certificates::{RateAssumption, RemainingMotion};
use super::moving_ball_cover::{MovingBallCover, Stretch};

/// Path time by which the certificate of a motion that may hurry reaches farther than it must, s, so that above half
/// the rate it holds for some states; below, the times have shifted too far with each state, and it is made anew.
const AHEAD_S: f64 = 0.1;

/// Beyond this distance from the base no part of the robot is, section lengths.
const REACH: f64 = SECTIONS as f64 + 0.5;
/// Least distance of two balls that cover a way, section lengths, and most of them: a small ball's way is looked at as far as that.
const LEAST_STEP: f64 = 0.02;
const MOST_STEPS: f64 = 1000.0;

/// The balls of a scene, in the planner's units (lengths in sections).
#[derive(Debug)]
pub(super) struct SceneBalls {
    pub(super) resting: Scene,
    /// The balls that move, where they are at the stamp of the message.
    pub(super) moving: Vec<MovingBall>,
}

/// The newest scene of a source, in the planner's units (lengths in sections).
#[derive(Debug)]
pub(super) struct RetainedScene {
    pub(super) scene: valid::Scene,
    balls: Arc<SceneBalls>,
    /// Number of the scene's content, another one for each.
    pub(super) version: u64,
}

impl RetainedScene {
    /// The scene of a message in metres; `version` is the next number of a content.
    pub(super) fn new(
        scene: valid::Scene,
        robot: &UnitRobot,
        version: u64,
    ) -> Result<Self, SceneError> {
        let (mut resting, mut moving) = (Vec::new(), Vec::new());
        for ball in &scene.balls {
            let ball = moving_ball(ball, robot);
            if ball.velocity == Point::zeros() {
                resting.push(ball.ball);
            } else {
                moving.push(ball);
            }
        }
        Ok(Self {
            scene,
            balls: Arc::new(SceneBalls {
                resting: Scene::new(resting)?,
                moving,
            }),
            version,
        })
    }

    /// The scene's balls, shared with who plans.
    pub(super) fn balls(&self) -> &Arc<SceneBalls> {
        &self.balls
    }

    /// Whether some of its balls move.
    pub(super) fn moves(&self) -> bool {
        !self.balls.moving.is_empty()
    }

    /// Whether what was certified for this one is certified for another one: moving balls count where they may be within the lifetime
    /// from the stamp on.
    pub(super) fn has_same_meaning(&self, scene: &valid::Scene) -> bool {
        let has_same_times = self.scene.stamp_mono_ns == scene.stamp_mono_ns
            && self.scene.lifetime_ns == scene.lifetime_ns;
        self.scene.balls == scene.balls && (self.balls.moving.is_empty() || has_same_times)
    }

    /// The verdict, and for which stretch it holds.
    pub(super) fn certify(
        &self,
        rest: &RemainingMotion,
        rate: RateAssumption,
        mut stretch: Stretch,
    ) -> (Verdict, Stretch) {
        if rate == RateAssumption::MeasuredRate {
            let resting =
                certify_trajectory(rest.padded, &self.balls.resting, rest.motion, rest.from_s);
            if !resting.is_free() {
                return (resting, stretch);
            }
        } else {
            stretch.until_s = (stretch.until_s + AHEAD_S).min(rest.motion.duration());
        }
        if self.balls.moving.is_empty() {
            return (Verdict::Free, stretch);
        }
        let cover = MovingBallCover {
            timing: stretch.timing,
            stamp_mono_ns: self.scene.stamp_mono_ns,
            lifetime_s: self.scene.lifetime_ns as f64 * 1e-9,
            stopping_s: rest.stopping_s,
            lag_allowance_s: rest.lag_allowance_s,
        };
        let times = [rest.from_s, stretch.until_s];
        let balls = cover.by_path_time(&self.balls.moving);
        let spread = cover.spread();
        let covers = Cover::ALL.into_iter();
        let covers = covers.filter_map(|kind| spread.cover(kind, &balls, rest.padded, times));
        let verdicts = covers.map(|balls| certify_moving(rest.padded, &balls, rest.motion, times));
        (free_or_first(verdicts), stretch)
    }

    /// Whether a robot that stays in a configuration, rad, keeps clear of the balls that move, as far as these keep their velocities.
    pub(super) fn stays_clear(
        &self,
        padded: &UnitRobot,
        configuration: &Configuration,
        now_mono_ns: i64,
    ) -> bool {
        let age_s = (now_mono_ns - self.scene.stamp_mono_ns) as f64 * 1e-9;
        self.balls.moving.iter().all(|moving| {
            let way = Scene::new(way_ahead(moving, age_s, REACH).collect());
            way.is_ok_and(|way| way.clearance_at(padded, configuration) > 0.0)
        })
    }
}

/// Balls that cover the way of a ball from a time, s, on until it is beyond `reach` of the base for good.
fn way_ahead(moving: &MovingBall, from_s: f64, reach: f64) -> impl Iterator<Item = Ball> {
    let MovingBall { ball, velocity } = *moving;
    let from = moving.at(from_s).centre;
    let speed = velocity.norm();
    let step = ball.radius.max(LEAST_STEP);
    let direction = velocity / speed.max(f64::MIN_POSITIVE);
    // The ball leaves the sphere of reach at the farther of its two places on the way; it has left where that lies behind.
    let along = from.dot(&direction);
    let reach = reach + ball.radius;
    let leaves = (along * along - from.norm_squared() + reach * reach)
        .max(0.0)
        .sqrt()
        - along;
    let steps = (leaves / step).ceil().clamp(0.0, MOST_STEPS);
    (0..=steps as usize).map(move |index| Ball {
        centre: from + direction * (step * index as f64),
        radius: ball.radius.hypot(0.5 * step),
    })
}

/// The verdict that a motion is free, if one says so; else the first one.
fn free_or_first(mut verdicts: impl Iterator<Item = Verdict>) -> Verdict {
    let first = verdicts.next().unwrap_or(Verdict::Free);
    if first.is_free() || verdicts.any(Verdict::is_free) {
        return Verdict::Free;
    }
    first
}

fn moving_ball(ball: &message::MovingBall, robot: &UnitRobot) -> MovingBall {
    MovingBall {
        ball: Ball {
            centre: robot.point_in_section_lengths(ball.centre_m),
            radius: robot.in_section_lengths(ball.radius_m),
        },
        velocity: robot.point_in_section_lengths(ball.velocity_m_s),
    }
}
