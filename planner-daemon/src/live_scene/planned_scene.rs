//! The live scene as part of a planning problem.

use std::collections::HashSet;
use std::sync::Arc;

use collision::{Ball, SceneError};
use planning::{MovingBalls, Problem};
use trajectory::RateLaw;

use super::moving_ball_cover::{MovingBallCover, Timing};
use super::retained_scene::SceneBalls;

/// The newest scenes of all sources, as supervision has them.
#[derive(Clone, Debug, Default)]
pub(crate) struct SceneSnapshot(pub(super) Vec<SourceSnapshot>);

/// The newest scene of a source.
#[derive(Clone, Debug)]
pub(super) struct SourceSnapshot {
    pub(super) balls: Arc<SceneBalls>,
    pub(super) stamp_mono_ns: i64,
    pub(super) end_mono_ns: i64,
}

/// When a motion is expected, and by what it may deviate from that.
pub(crate) struct ExpectedMotion<'a> {
    pub(crate) timing: Timing,
    /// How much earlier or later than expected it may be published, s.
    pub(crate) slack_s: f64,
    /// How much later it must be able to come, s.
    pub(crate) lag_allowance_s: f64,
    /// Time until a stop begins, s.
    pub(crate) order_delay_s: f64,
    /// The law by which it is stopped.
    pub(crate) rate_law: &'a RateLaw,
}

impl SceneSnapshot {
    /// Whether an obstacle moves in a scene whose lifetime is not over.
    pub(crate) fn moves(&self, now_mono_ns: i64) -> bool {
        let mut live = self.0.iter();
        live.any(|source| now_mono_ns < source.end_mono_ns && !source.balls.moving.is_empty())
    }

    /// The problem with the obstacles of all scenes, each once, whose lifetime is not over: what moves counts wherever the certificate at publication
    /// will take it to be. None where there are no obstacles.
    ///
    /// # Errors
    /// [`SceneError`] where these are too many together.
    pub(crate) fn in_problem(
        &self,
        problem: &Problem,
        expected: &ExpectedMotion,
        now_mono_ns: i64,
    ) -> Result<Option<Problem>, SceneError> {
        let is_live = |source: &&SourceSnapshot| now_mono_ns < source.end_mono_ns;
        let sources = || self.0.iter().filter(is_live);
        let mut known: HashSet<[u64; 4]> = problem.scene.balls().iter().map(bits).collect();
        let resting = sources().flat_map(|source| source.balls.resting.balls());
        let resting: Vec<Ball> = resting
            .filter(|ball| known.insert(bits(ball)))
            .copied()
            .collect();
        let moving = sources().filter(|source| !source.balls.moving.is_empty());
        let moving: Vec<MovingBalls> = moving.map(|source| source.expected(expected)).collect();
        if resting.is_empty() && moving.is_empty() {
            return Ok(None);
        }
        let mut problem = Problem {
            scene: problem.scene.with_balls(resting)?,
            ..problem.clone()
        };
        problem.moving.braking = Some(expected.rate_law.clone());
        problem.moving.sources.extend(moving);
        Ok(Some(problem))
    }
}

/// The bits by which a ball is known that is told of twice.
fn bits(ball: &Ball) -> [u64; 4] {
    let Ball { centre, radius } = ball;
    [centre.x, centre.y, centre.z, *radius].map(f64::to_bits)
}

impl SourceSnapshot {
    /// The moving balls as a motion meets them.
    fn expected(&self, expected: &ExpectedMotion) -> MovingBalls {
        let cover = MovingBallCover {
            timing: expected.timing,
            stamp_mono_ns: self.stamp_mono_ns,
            lifetime_s: (self.end_mono_ns - self.stamp_mono_ns) as f64 * 1e-9,
            stopping_s: expected.order_delay_s + expected.slack_s,
            lag_allowance_s: expected.lag_allowance_s,
        };
        MovingBalls {
            balls: cover.by_path_time(&self.balls.moving),
            spread: cover.spread(),
        }
    }
}
