//! Balls that move while the robot does, and where they can be when it is at a place of its motion.

use collision::{Ball, Cover, MovingBall, Scene, TimeSpread};
use pcc_model::{Configuration, UnitRobot};
use trajectory::{RateLaw, Trajectory};

/// Longest distance of two balls that cover the way of one, radii: they are a quarter larger then.
const SPACING: f64 = 1.5;
/// Most balls that cover the way of one.
const MAX_BALLS_OF_A_WAY: usize = 24;

/// A usual longest stop of a motion, s, where the motion is not known.
pub(crate) const USUAL_STOP_S: f64 = 0.3;
/// Step between the delays of a begin that are tried, s.
const DELAY_STEP_S: f64 = 0.25;
/// Steps by which a begin is delayed at most: 6 s.
const DELAY_STEPS: u32 = 24;

/// The balls of one source, and by how much they may be ahead or behind.
#[derive(Clone, Debug)]
pub struct MovingBalls {
    /// The balls where they are expected at the motion's time zero; velocities in section lengths/s.
    pub balls: Vec<MovingBall>,
    /// By how much they may be behind or ahead whatever the motion, s; the time of a stop on it is added.
    pub spread: TimeSpread,
}

impl MovingBalls {
    /// By how much they may be behind or ahead of a motion on which a stop takes so long.
    fn spread_with(&self, stop_s: f64) -> TimeSpread {
        TimeSpread {
            earliest: self.spread.earliest - stop_s,
            latest: self.spread.latest + stop_s,
            seen: self.spread.seen,
        }
    }
}

/// Balls that move while the robot does, as a motion must keep clear of them; none by default.
#[derive(Clone, Debug, Default)]
pub struct MovingObstacles {
    /// The balls, by source.
    pub sources: Vec<MovingBalls>,
    /// The law by which a motion is stopped; where there is none, a stop takes no time.
    pub braking: Option<RateLaw>,
}

/// No balls that move.
pub(crate) static NONE: MovingObstacles = MovingObstacles {
    sources: Vec::new(),
    braking: None,
};

impl MovingObstacles {
    /// Whether no ball moves.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.sources.iter().all(|source| source.balls.is_empty())
    }

    /// Smallest clearance of a robot in this configuration (rad) at the motion's time zero; +∞ where no ball moves.
    pub(crate) fn clearance_at(&self, robot: &UnitRobot, configuration: &Configuration) -> f64 {
        let backbone = robot.backbone(configuration);
        let balls = self.sources.iter().flat_map(|source| &source.balls);
        let clearances = balls.flat_map(|moving| {
            let Ball { centre, radius } = moving.ball;
            let of_section = move |(k, tube): (usize, f64)| (k, centre, radius + tube);
            robot.tube_radii.into_iter().enumerate().map(of_section)
        });
        clearances
            .map(|(k, centre, radius)| backbone.distance(k, &centre) - radius)
            .fold(f64::INFINITY, f64::min)
    }

    /// Whether no motion from a configuration (rad) can be certified: a ball can be there when it begins.
    pub(crate) fn may_touch_at_once(
        &self,
        robot: &UnitRobot,
        configuration: &Configuration,
    ) -> bool {
        self.covered_clearance(robot, configuration, 0.0) < 0.0
    }

    /// How much later a motion from a configuration (rad) must begin so that no ball can be there then, s: 0 where it can at once. None
    /// where it cannot within 6 s, or where a ball is there at its time zero.
    #[must_use]
    pub fn delay_of_begin_s(
        &self,
        robot: &UnitRobot,
        configuration: &Configuration,
    ) -> Option<f64> {
        if self.is_empty() {
            return Some(0.0);
        }
        if self.clearance_at(robot, configuration) < 0.0 {
            return None;
        }
        let delays = (0..=DELAY_STEPS).map(|step| DELAY_STEP_S * f64::from(step));
        let is_clear = |delay_s: &f64| {
            let later = self.after(*delay_s);
            later.covered_clearance(robot, configuration, USUAL_STOP_S) > 0.0
        };
        delays.into_iter().find(is_clear)
    }

    /// Smallest clearance of a robot in this configuration (rad) from everywhere that a ball can be at the time zero of a motion on which a
    /// stop takes so long.
    fn covered_clearance(
        &self,
        robot: &UnitRobot,
        configuration: &Configuration,
        stop_s: f64,
    ) -> f64 {
        let clearances = self.covers(robot, stop_s, [0.0; 2]).map(|covering| {
            let at_once = covering.iter().map(|moving| moving.ball).collect();
            let scene = Scene::new(at_once).unwrap_or_default();
            scene.clearance_at(robot, configuration)
        });
        clearances.fold(f64::NEG_INFINITY, f64::max)
    }

    /// The same balls for a motion whose time zero is `later_s` seconds later.
    #[must_use]
    pub fn after(&self, later_s: f64) -> Self {
        let mut after = self.clone();
        for source in &mut after.sources {
            source.spread.seen -= later_s;
            for moving in &mut source.balls {
                moving.ball = moving.at(later_s);
            }
        }
        after
    }

    /// Longest time of a stop on a motion, s.
    pub(crate) fn longest_stop_s(&self, motion: &Trajectory) -> f64 {
        let braking = self.braking.as_ref();
        braking.map_or(0.0, |law| law.longest_stop(motion.knots()))
    }

    /// Balls that cover all places where the balls can be between two times of a motion (s) on which a stop takes so long; none where it is not
    /// known of all of them when they were seen, and that is asked for.
    pub(crate) fn cover(
        &self,
        cover: Cover,
        robot: &UnitRobot,
        stop_s: f64,
        times: [f64; 2],
    ) -> Option<Vec<MovingBall>> {
        let mut covering = Vec::new();
        for source in self.sources.iter().filter(|it| !it.balls.is_empty()) {
            let spread = source.spread_with(stop_s);
            covering.extend(spread.cover(cover, &source.balls, robot, times)?);
        }
        Some(covering)
    }

    /// Whether a robot that stands in a configuration (rad) from the end (s) of a motion on keeps clear of the balls, where a stop on the motion
    /// takes so long.
    pub(crate) fn stands_clear(
        &self,
        robot: &UnitRobot,
        configuration: &Configuration,
        stop_s: f64,
        end_s: f64,
    ) -> bool {
        self.sources.iter().all(|source| {
            let spread = source.spread_with(stop_s);
            spread.stands_clear(&source.balls, robot, configuration, end_s)
        })
    }

    /// The sets of balls, each of which covers by itself all places where the balls can be; each is made when it is asked for.
    pub(crate) fn covers(
        &self,
        robot: &UnitRobot,
        stop_s: f64,
        times: [f64; 2],
    ) -> impl Iterator<Item = Vec<MovingBall>> {
        let known = move |cover| self.cover(cover, robot, stop_s, times);
        Cover::ALL.into_iter().filter_map(known)
    }

    /// Whether all balls were seen so lately that in a motion of this duration (s) they come to fewer places since then than they might
    /// have been late for.
    pub(crate) fn is_seen_within(&self, duration_s: f64) -> bool {
        let mut spreads = self.sources.iter().map(|source| source.spread);
        spreads.all(|spread| duration_s - spread.seen < -spread.earliest)
    }

    /// `scene` with balls at rest that cover the way of each ball until `until_s` seconds after the motion's time zero; the scene alone
    /// where that makes too many balls.
    pub(crate) fn swept_into(&self, scene: &Scene, robot: &UnitRobot, until_s: f64) -> Scene {
        let covering = self.cover(Cover::MovingAlong, robot, 0.0, [0.0, until_s]);
        let covering = covering.unwrap_or_default();
        let way = |ball| covering_way(ball, until_s);
        let balls = covering.into_iter().flat_map(way).collect();
        scene.with_balls(balls).unwrap_or_else(|_| scene.clone())
    }
}

/// Balls at rest that cover a ball's way in `until_s` seconds.
fn covering_way(moving: MovingBall, until_s: f64) -> impl Iterator<Item = Ball> {
    let way = moving.velocity.norm() * until_s;
    let pieces = (way / (SPACING * moving.ball.radius)).ceil();
    let pieces = pieces.clamp(1.0, MAX_BALLS_OF_A_WAY as f64 - 1.0);
    let radius = moving.ball.radius.hypot(0.5 * way / pieces);
    (0..=pieces as usize).map(move |i| Ball {
        radius,
        ..moving.at(until_s * (i as f64 / pieces))
    })
}
