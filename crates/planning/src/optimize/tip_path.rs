//! Tip paths: the tip of a path is brought onto a smooth curve near it (decision 0011).
//!
//! A sampled path comes near the straight path of the tip, with small waves in it. Where the scene allows, the curve is the
//! straight line at even speed, bent at its ends where the robot cannot set out along it, or as much nearer to the straight
//! segment's tip path as the bending limits demand. The tip of a nearly straight robot, which sets out sideways only, is brought onto
//! the line at the pace of the sampled path: with a speed of zero at first it goes exactly straight. Where the body would come
//! too near to an obstacle on all such curves, the path is first corrected, and its tip then brought onto the first curve that leaves
//! room: mixtures of its smoothed tip path and the straight segment's, then its own, smoothed less.

use crate::optimize::corner_precompensation::precompensated;
use crate::optimize::tip_tracker::{TipDemand, TipTracker};
use crate::path::smoothing_spline::Smoother;
use crate::path::waypoints::{WAYPOINTS, WaypointArray, Waypoints, parameter, straight_path};
use collision::Scene;
use nalgebra::SymmetricEigen;
use pcc_model::{Backbone, Configuration, Point, SECTIONS, TendonLimits, UnitRobot};
use std::iter::once;

/// Strengths of the smoothing of a tip's path, or of configurations, in the order in which they are tried: they remove waves shorter
/// than 43, 29, 20 and 14 waypoints.
const STRENGTHS: [f64; 4] = [1e5, 1e4, 1e3, 1e2];
/// Shares of the straight segment's tip path in the curve of a path that needs no correction, in the order in which they are tried.
const SHARES: [f64; 3] = [0.0, 0.5, 0.8];
/// Largest share of the straight segment's tip path that is tried first beside a corrected path: with larger ones no more paths are smooth
/// than with fixed shares (docs/evaluation-history.md "Tip paths").
const LARGEST_FIRST_SHARE: f64 = 0.5;
/// Step between the shares that are tried after that one.
const SHARE_STEP: f64 = 0.07;
/// Steps to either side of the first share: 7 × 0.07 = 0.49, from 0.5 nearly to 0 and to 1.
const SHARE_STEPS: i8 = 7;
/// A tip that moves less than this in some direction by a rad of bending cannot set out in that direction, section lengths per rad.
const STIFF: f64 = 0.6;
/// Stiffness of an end above which the tip follows the line at the pace of the path: that of a straight robot sets out sideways only.
const STIFFEST: f64 = 0.9;
/// Share of the straight segment's tip path in the curve where an end is as stiff as can be.
const SEGMENT_SHARE: f64 = 0.35;
/// Width of the band below the bending limit in which bending is compressed, so that a path does not run into its limits with a kink,
/// rad.
const SOFT_RAD: f64 = 0.15;

/// The tip at each waypoint of a path.
type Tips = [Point; WAYPOINTS];

/// Paths whose tips follow smooth curves, and paths without waves.
pub(crate) struct TipPaths {
    smoothers: [Smoother; STRENGTHS.len()],
}

impl TipPaths {
    pub(crate) fn new() -> Self {
        Self {
            smoothers: STRENGTHS.map(Smoother::new),
        }
    }

    /// Brings the tip of a path (64 waypoints, radians) onto the straightest curve on which the body keeps a clearance of
    /// `margin` beyond the tube (section lengths); both ends stay exactly where they are. Where there is none, the path stays
    /// as it is.
    ///
    /// `limits` are those of the motion. Returns whether there is such a curve.
    pub(crate) fn straighten_tip(
        &self,
        robot: &UnitRobot,
        scene: &Scene,
        margin: f64,
        limits: &TendonLimits,
        path: &mut [Configuration],
    ) -> bool {
        let tip_line = TipLine::new(robot, &path[0], &path[WAYPOINTS - 1]);
        let tracker = TipTracker {
            robot,
            scene,
            margin,
            ends: tip_line.ends,
        };
        let tracked = if tip_line.stiffness > STIFFEST {
            self.at_its_own_pace(&tip_line, &tracker, path)
        } else {
            straight(&tip_line, &tracker, path)
        };
        if let Some(tracked) = &tracked {
            path.copy_from_slice(&precompensated(robot, limits, tracked));
        }
        tracked.is_some()
    }

    /// Brings the tip onto a smooth curve on which the body keeps a clearance of `margin` beyond the tube (section lengths); both
    /// ends stay exactly where they are. Returns whether there is such a curve; where there is none, the path stays as it is.
    ///
    /// Pushes leave a path rougher, and farther from the straight segment, than it must be: mixtures of its smoothed tip path with the
    /// segment's are tried first, then its own tip path, smoothed less and less.
    pub(crate) fn smooth_tip(
        &self,
        robot: &UnitRobot,
        scene: &Scene,
        margin: f64,
        path: &mut [Configuration],
    ) -> bool {
        let ends = [path[0], path[WAYPOINTS - 1]];
        let tracker = TipTracker {
            robot,
            scene,
            margin,
            ends,
        };
        let demand = TipDemand {
            loose: None,
            keeps_limits: false,
        };
        let segment = straight_path(&ends[0], &ends[1]);
        let tips_of = |path: &[Configuration]| std::array::from_fn(|h| robot.tip(&path[h]));
        let (tips, segment_tips): (Tips, Tips) = (tips_of(path), tips_of(&segment));
        let track = |curve: &Tips, share: f64| {
            tracker.track(
                &demand,
                |h| path[h].lerp(&segment[h], share),
                |h| curve[h].lerp(&segment_tips[h], share),
            )
        };
        let [strongest, weaker @ ..] = &self.smoothers;
        let smoothest = strongest.smooth(&tips);
        let first = smoothest_share(&smoothest, &segment_tips);
        let tracked = shares_beside(first)
            .find_map(|share| track(&smoothest, share))
            .or_else(|| weaker.iter().find_map(|it| track(&it.smooth(&tips), 0.0)));
        if let Some(tracked) = &tracked {
            path.copy_from_slice(tracked);
        }
        tracked.is_some()
    }

    /// The configurations of a path (64 waypoints, radians) without their waves, the strongest smoothing first, wherever that leads; both
    /// ends stay exactly where they are.
    pub(crate) fn smoothed(&self, path: Waypoints) -> impl Iterator<Item = Waypoints> {
        let smoothed = move |smoother: &Smoother| smooth_configurations(smoother, &path).to_vec();
        self.smoothers.iter().map(smoothed)
    }

    /// The path whose tip is on the line between its two ends, at the pace of the given path without its waves.
    fn at_its_own_pace(
        &self,
        tip_line: &TipLine,
        tracker: &TipTracker,
        path: &[Configuration],
    ) -> Option<WaypointArray> {
        let line = tip_line.line.try_normalize(0.0)?;
        let smooth = smooth_configurations(&self.smoothers[0], path);
        let demand = TipDemand {
            loose: Some(line),
            keeps_limits: true,
        };
        let guess = |h: usize| tip_line.softened(h, &smooth[h]);
        tracker.track(&demand, guess, |h| tip_line.on_the_line(h))
    }
}

/// The share of `other`, 0 to [`LARGEST_FIRST_SHARE`], with which the mixture of two tip paths has the least sum of squared third
/// differences; 0 where both have the same.
fn smoothest_share(curve: &Tips, other: &Tips) -> f64 {
    let third = |w: &[Point]| w[3] - w[0] + (w[1] - w[2]) * 3.0;
    // The share s minimises Σ‖a − s d‖²: s = Σ a·d / Σ‖d‖². The smallest number keeps 0 / 0 away.
    let (mut product, mut square) = (0.0, f64::MIN_POSITIVE);
    for (curve, other) in curve.windows(4).zip(other.windows(4)) {
        let own = third(curve);
        let difference = own - third(other);
        product += own.dot(&difference);
        square += difference.norm_squared();
    }
    (product / square).clamp(0.0, LARGEST_FIRST_SHARE)
}

/// A share, then those up to [`SHARE_STEPS`] steps of [`SHARE_STEP`] less and more, the nearest first, as far as they are from 0 (the
/// curve alone) to below 1 (the segment's tip path alone).
fn shares_beside(first: f64) -> impl Iterator<Item = f64> {
    let steps = (1..=SHARE_STEPS).flat_map(|step| [-step, step]);
    let shares = once(0).chain(steps);
    let shares = shares.map(move |step| first + SHARE_STEP * f64::from(step));
    shares.filter(|share| (0.0..1.0).contains(share))
}

/// The configurations of a path, smoothed.
fn smooth_configurations(smoother: &Smoother, path: &[Configuration]) -> WaypointArray {
    smoother.smooth(&std::array::from_fn(|h| path[h]))
}

/// The path whose tip is on the straightest curve that keeps the bending limits.
fn straight(
    tip_line: &TipLine,
    tracker: &TipTracker,
    path: &[Configuration],
) -> Option<WaypointArray> {
    let demand = TipDemand {
        loose: None,
        keeps_limits: true,
    };
    SHARES.iter().find_map(|&share| {
        tracker.track(
            &demand,
            |h| tip_line.guess(h, &path[h], share),
            |h| tip_line.straightest(h, share),
        )
    })
}

/// The two ends of a path, and how far the tip cannot set out there in every direction.
struct TipLine<'a> {
    robot: &'a UnitRobot,
    ends: [Configuration; 2],
    /// The change that compressing would make at each end, rad.
    compressions: [Configuration; 2],
    first_tip: Point,
    /// Vector from the first tip to the last, section lengths.
    line: Point,
    /// Bend of the tip's line at its middle, times 4, that spares the directions in which the tip is stiff.
    bend: Point,
    /// How stiff the tip is at the stiffer end, 0 to 1.
    stiffness: f64,
}

impl<'a> TipLine<'a> {
    fn new(robot: &'a UnitRobot, start: &Configuration, end: &Configuration) -> Self {
        let ends = [*start, *end];
        let [first, last] = ends.map(|configuration| robot.backbone(&configuration));
        let line = last.tip() - first.tip();
        let [at_start, at_end] = [&first, &last].map(stiffest);
        let part =
            |(direction, stiffness): (Point, f64)| direction * (direction.dot(&line) * stiffness);
        Self {
            robot,
            ends,
            compressions: ends.map(|end| end - compressed(robot, &end)),
            first_tip: first.tip(),
            line,
            bend: part(at_end) - part(at_start),
            stiffness: at_start.1.max(at_end.1),
        }
    }

    fn segment(&self, h: usize) -> Configuration {
        self.ends[0].lerp(&self.ends[1], parameter(h))
    }

    fn on_the_line(&self, h: usize) -> Point {
        self.first_tip + self.line * parameter(h)
    }

    /// The straight line of the tip at even speed; at a stiff end it sets out as the tip can. It follows with `share`, and
    /// with more at a stiff end, the tip path of the straight segment.
    fn straightest(&self, h: usize, share: f64) -> Point {
        let u = parameter(h);
        let line = self.on_the_line(h) + self.bend * (u * (1.0 - u));
        let share = share.max(SEGMENT_SHARE * self.stiffness);
        if share == 0.0 {
            return line;
        }
        line.lerp(&self.robot.tip(&self.segment(h)), share)
    }

    /// A sampled configuration with its bending compressed near the limit, as far as the ends allow.
    fn softened(&self, h: usize, sampled: &Configuration) -> Configuration {
        let [at_start, at_end] = self.compressions;
        compressed(self.robot, sampled) + at_start.lerp(&at_end, parameter(h))
    }

    /// Where the Newton steps for waypoint `h` begin: the softened sampled configuration, moved towards the straight segment's by the
    /// larger of `share` and the stiffness.
    fn guess(&self, h: usize, sampled: &Configuration, share: f64) -> Configuration {
        let share = share.max(self.stiffness);
        self.softened(h, sampled).lerp(&self.segment(h), share)
    }
}

/// The direction in which the tip moves least, and how stiff it is there, 0 to 1.
fn stiffest(backbone: &Backbone) -> (Point, f64) {
    let jacobian = backbone.tip_jacobian();
    let modes = SymmetricEigen::new(jacobian * jacobian.transpose());
    let least = modes.eigenvalues.imin();
    let mobility = modes.eigenvalues[least].max(0.0).sqrt();
    let direction = modes.eigenvectors.column(least).into_owned();
    (direction, (1.0 - mobility / STIFF).max(0.0))
}

fn compressed(robot: &UnitRobot, configuration: &Configuration) -> Configuration {
    let angles = robot.bending_angles(configuration);
    let begin = robot.bending_limit - SOFT_RAD;
    let mut soft = *configuration;
    for section in (0..SECTIONS).filter(|&section| angles[section] > begin) {
        let excess = (angles[section] - begin) / SOFT_RAD;
        let angle = begin + SOFT_RAD * excess.tanh();
        let mut bend = soft.fixed_rows_mut::<2>(2 * section);
        bend *= angle / angles[section];
    }
    soft
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::unit_robot;
    use collision::Ball;

    fn straighten(robot: &UnitRobot, path: &mut [Configuration]) -> bool {
        TipPaths::new().straighten_tip(robot, &Scene::default(), 0.0, &robot.tendon_limits, path)
    }

    fn ends() -> [Configuration; 2] {
        [
            Configuration::from_column_slice(&[0.9, -0.4, -0.6, 0.6, 0.4, 0.8]),
            Configuration::from_column_slice(&[0.7, 0.1, -0.3, 0.9, 0.5, 0.6]),
        ]
    }

    #[test]
    fn a_tip_that_wanders_a_little_goes_straight() {
        let robot = unit_robot();
        let [start, end] = ends();
        let mut path = straight_path(&start, &end);
        for (h, waypoint) in path.iter_mut().enumerate() {
            let wave = (20.0 * parameter(h)).sin() * parameter(h) * (1.0 - parameter(h));
            waypoint[1] += 0.02 * wave;
        }
        let bend = |path: &[Configuration]| {
            let tips: Vec<Point> = path.iter().map(|q| robot.tip(q)).collect();
            let third = |w: &[Point]| (w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0]).norm_squared();
            tips.windows(4).map(third).sum::<f64>()
        };
        let before = bend(&path);
        assert!(straighten(&robot, &mut path));
        assert!(bend(&path) < 0.2 * before, "{} of {before}", bend(&path));
        assert_eq!([path[0], path[63]], [start, end]);
    }

    #[test]
    fn the_tip_of_a_straight_robot_goes_straight_along_an_s_bend() {
        let robot = unit_robot();
        let start = Configuration::zeros();
        let end = Configuration::from_column_slice(&[0.7, 0.2, -1.1, -0.1, 0.6, 0.1]);
        let way = robot.tip(&end) - robot.tip(&start);
        let beside = |path: &[Configuration]| {
            let off = |q| way.cross(&(robot.tip(q) - robot.tip(&start))).norm() / way.norm();
            path.iter().map(off).fold(0.0, f64::max)
        };
        let mut path = straight_path(&start, &end);
        assert!(beside(&path) > 0.02, "the segment's tip leaves the line");
        assert!(straighten(&robot, &mut path));
        assert!(beside(&path) < 5e-4, "{}", beside(&path));
        assert_eq!([path[0], path[63]], [start, end]);
    }

    /// A detour with short waves in it, as pushes leave it.
    fn jagged() -> Vec<Configuration> {
        let [start, end] = ends();
        let mut path = straight_path(&start, &end);
        for (h, waypoint) in path.iter_mut().enumerate().take(WAYPOINTS - 1).skip(1) {
            let u = parameter(h);
            waypoint[1] += 0.5 * u * (1.0 - u) + 0.01 * (30.0 * u).sin();
        }
        path
    }

    #[test]
    fn smoothing_takes_the_short_waves_from_a_tip_and_leaves_the_ends() {
        let robot = unit_robot();
        let third = |path: &[Configuration]| {
            let tips: Vec<Point> = path.iter().map(|q| robot.tip(q)).collect();
            let third = |w: &[Point]| (w[3] - w[0] + (w[1] - w[2]) * 3.0).norm_squared();
            tips.windows(4).map(third).sum::<f64>()
        };
        let given = jagged();
        let mut path = given.clone();
        assert!(TipPaths::new().smooth_tip(&robot, &Scene::default(), 0.01, &mut path));
        assert!(third(&path) < 0.01 * third(&given));
        assert_eq!([path[0], path[63]], [given[0], given[63]]);
    }

    #[test]
    fn a_detour_that_is_wider_than_it_must_be_comes_nearer_to_the_segment() {
        let robot = unit_robot();
        let segment = straight_path(&jagged()[0], &jagged()[63]);
        let widest = |path: &[Configuration]| {
            let off = path
                .iter()
                .zip(&segment)
                .map(|(q, s)| robot.tip(q) - robot.tip(s));
            off.map(|off| off.norm()).fold(0.0, f64::max)
        };
        let mut path = jagged();
        assert!(TipPaths::new().smooth_tip(&robot, &Scene::default(), 0.01, &mut path));
        assert!(widest(&path) < 0.6 * widest(&jagged()));
    }

    #[test]
    fn shares_go_to_both_sides_from_0_to_below_1() {
        let of = |first| shares_beside(first).collect::<Vec<f64>>();
        assert_eq!(of(0.03)[..2], [0.03, 0.03 + SHARE_STEP]);
        assert_eq!(of(0.3)[..3], [0.3, 0.3 - SHARE_STEP, 0.3 + SHARE_STEP]);
        let counts = [0.0, 0.03, LARGEST_FIRST_SHARE].map(|first| of(first).len());
        assert_eq!(counts, [8, 8, 15]);
    }

    #[test]
    fn the_smoothest_share_is_bounded_and_none_for_equal_paths() {
        let line: Tips = std::array::from_fn(|h| Point::x() * parameter(h));
        let bent: Tips = std::array::from_fn(|h| Point::y() * parameter(h).powi(3));
        assert!(smoothest_share(&bent, &bent).abs() < 1e-12);
        assert!(smoothest_share(&line, &bent) < 1e-9);
        assert!((smoothest_share(&bent, &line) - LARGEST_FIRST_SHARE).abs() < 1e-12);
    }

    #[test]
    fn smoothing_leaves_a_path_that_has_no_room() {
        let robot = unit_robot();
        let given = jagged();
        let ball = Ball {
            centre: robot.tip(&given[33]),
            radius: 0.1,
        };
        let scene = Scene::new(vec![ball]).unwrap();
        let mut path = given.clone();
        assert!(!TipPaths::new().smooth_tip(&robot, &scene, 0.01, &mut path));
        assert_eq!(path, given);
    }

    #[test]
    fn a_way_around_a_ball_on_the_line_stays_as_it_is() {
        let robot = unit_robot();
        let [start, end] = ends();
        let mut path = straight_path(&start, &end);
        let ball = Ball {
            centre: robot.tip(&path[32]),
            radius: 0.1,
        };
        let scene = Scene::new(vec![ball]).unwrap();
        for (h, waypoint) in path.iter_mut().enumerate() {
            waypoint[3] += 1.2 * (std::f64::consts::PI * parameter(h)).sin();
        }
        (path[0], path[63]) = (start, end);
        let sampled = path.clone();
        let limits = &robot.tendon_limits;
        assert!(!TipPaths::new().straighten_tip(&robot, &scene, 0.0, limits, &mut path));
        assert_eq!(path, sampled);
    }
}
