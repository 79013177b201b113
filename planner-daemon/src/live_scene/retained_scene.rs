//! The newest accepted scene of a source in the planner's units, and its certification.

use std::sync::Arc;

use collision::{
    Ball, Cover, MovingBall, Scene, SceneError, TimeSpread, Verdict, certify_moving,
    certify_trajectory,
};
use pcc_model::{Configuration, Point, UnitRobot};
use shared_types::message;
use shared_types::valid;

use super::certificates::{RateAssumption, RemainingMotion};
use super::in_the_way::InTheWay;
use super::moving_ball_cover::{MovingBallCover, Stretch};

/// Path time by which the certificate of a motion that may hurry reaches farther than it must, s, so that above half
/// the rate it holds for some states; below, the times have shifted too far with each state, and it is made anew.
const AHEAD_S: f64 = 0.1;

/// Balls that are neither early nor late.
const ON_TIME: TimeSpread = TimeSpread {
    earliest: 0.0,
    latest: 0.0,
    seen: f64::NEG_INFINITY,
};

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

    /// For which stretch the rest of a motion, and standing at its end, is certified free of this scene.
    pub(super) fn certify(
        &self,
        rest: &RemainingMotion,
        rate: RateAssumption,
        mut stretch: Stretch,
    ) -> Result<Stretch, InTheWay> {
        if rate == RateAssumption::MeasuredRate {
            on_the_way(certify_trajectory(
                rest.padded,
                &self.balls.resting,
                rest.motion,
                rest.progress.passed_s(),
            ))?;
        } else {
            stretch.until_s = (stretch.until_s + AHEAD_S).min(rest.motion.duration());
        }
        if self.balls.moving.is_empty() {
            return Ok(stretch);
        }
        let cover = MovingBallCover {
            timing: stretch.timing,
            stamp_mono_ns: self.scene.stamp_mono_ns,
            lifetime_s: self.scene.lifetime_ns as f64 * 1e-9,
            stopping_s: rest.stopping_s,
            lag_allowance_s: rest.lag_allowance_s,
        };
        let times = [rest.progress.passed_s(), stretch.until_s];
        let balls = cover.by_path_time(&self.balls.moving);
        let spread = cover.spread();
        let covers = Cover::ALL.into_iter();
        let covers = covers.filter_map(|kind| spread.cover(kind, &balls, rest.padded, times));
        let verdicts = covers.map(|balls| certify_moving(rest.padded, &balls, rest.motion, times));
        on_the_way(free_or_first(verdicts))?;
        let stands = |at| spread.stands_clear(&balls, rest.padded, &at, rest.motion.duration());
        match rest.place_of_standing(rate).is_none_or(stands) {
            true => Ok(stretch),
            false => Err(InTheWay::AtTheEnd),
        }
    }

    /// Whether a robot that stands in a configuration, rad, keeps clear of the balls that move, as far as these keep their velocities.
    pub(super) fn stands_clear(
        &self,
        padded: &UnitRobot,
        configuration: &Configuration,
        now_mono_ns: i64,
    ) -> bool {
        let age_s = (now_mono_ns - self.scene.stamp_mono_ns) as f64 * 1e-9;
        ON_TIME.stands_clear(&self.balls.moving, padded, configuration, age_s)
    }
}

fn on_the_way(verdict: Verdict) -> Result<(), InTheWay> {
    match verdict {
        Verdict::Free => Ok(()),
        Verdict::Colliding { at } | Verdict::Undecided { at } => {
            Err(InTheWay::OnTheWay { at_s: at })
        }
    }
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
