//! Random cases: the reference's fixed layouts, general scenes, hard scenes (docs/evaluation.md "Cases").

use collision::{Ball, Scene, certify_polyline};
use pcc_model::{Configuration, Point, UnitRobot};
use planning::{
    Goal, MovingObstacles, Problem, RrtSettings, goal_configurations, random_configuration,
    rrt_connect, straight_path,
};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::f64::consts::{SQRT_2, TAU};
use std::ops::RangeInclusive;

/// Clearance asked of targets and starts beyond the tube: 1.5 × 0.2 − 0.2 section lengths.
const ENDPOINT_CLEARANCE: f64 = 0.1;
/// Distance of the balls from the axis in the layouts of 2 and 4 balls, section lengths.
pub(crate) const LAYOUT_RADIUS: f64 = 1.2;
/// Starts drawn for one target.
pub const STARTS: usize = 5;

/// Distances from the base axis, and heights, of the workspace of targets, section lengths.
pub(crate) const WORKSPACE_RADII: RangeInclusive<f64> = 0.1..=2.5;
pub(crate) const WORKSPACE_HEIGHTS: RangeInclusive<f64> = 1.5..=3.0;

/// Which kind of scene a case has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Setting {
    /// The paper's four fixed layouts, cycled by target index over 0, 1, 2, 4 balls, or one of them.
    Reference(Option<usize>),
    /// No balls.
    ObstacleFree,
    /// Random balls, counts cycled over 0, 1, 2, 3, 4, 5, 6, 8, or a fixed count.
    General(Option<usize>),
    /// Random scenes of 8–16 balls in which straight segments collide and a tree finds a way.
    Hard,
}

/// One target with its starts in one scene.
#[derive(Clone, Debug)]
pub struct Target {
    /// The obstacles, section lengths.
    pub scene: Scene,
    /// Tip position to reach, base frame, section lengths.
    pub tip: Point,
    /// The configuration that generated the target.
    pub generator: Configuration,
    /// Start shapes, each clear, distinct, and away from the target.
    pub starts: Vec<Configuration>,
}

/// Draws target `index` of a setting; the same seed and index give the same target whatever the order.
///
/// Nothing where this index has no valid target, as in the reference's generator.
#[must_use]
pub fn draw_target(robot: &UnitRobot, setting: Setting, seed: u64, index: u64) -> Option<Target> {
    let mut rng = Pcg64::seed_from_u64(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ index);
    let scene = Scene::new(draw_balls(setting, index, &mut rng)).ok()?;
    let (generator, tip) = (0..200).find_map(|_| draw_tip(robot, &scene, &mut rng))?;
    let mut starts = draw_starts(robot, &scene, &tip, &mut rng);
    if setting == Setting::Hard {
        starts.retain(|start| is_hard(robot, &scene, &tip, start, &mut rng));
    }
    (!starts.is_empty()).then_some(Target {
        scene,
        tip,
        generator,
        starts,
    })
}

/// The balls of a target's scene.
pub(crate) fn draw_balls(setting: Setting, index: u64, rng: &mut Pcg64) -> Vec<Ball> {
    match setting {
        Setting::ObstacleFree => Vec::new(),
        Setting::Reference(fixed) => {
            reference_layout(fixed.unwrap_or([0, 1, 2, 4][(index % 4) as usize]))
        }
        Setting::General(fixed) => {
            let cycled = [0, 1, 2, 3, 4, 5, 6, 8][(index % 8) as usize];
            random_balls(fixed.unwrap_or(cycled), rng)
        }
        Setting::Hard => {
            let count = rng.random_range(8..=16);
            random_balls(count, rng)
        }
    }
}

/// The authors' layouts of 0, 1, 2 or 4 balls of radius 0.4 at height 1.5.
#[must_use]
pub fn reference_layout(count: usize) -> Vec<Ball> {
    let o = LAYOUT_RADIUS / SQRT_2;
    let corners: &[(f64, f64)] = match count {
        0 => &[],
        1 => &[(0.0, 0.0)],
        2 => &[(1.0, 1.0), (-1.0, -1.0)],
        _ => &[(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)],
    };
    corners
        .iter()
        .map(|(x, y)| Ball {
            centre: Point::new(x * o, y * o, 1.5),
            radius: 0.4,
        })
        .collect()
}

fn random_balls(count: usize, rng: &mut Pcg64) -> Vec<Ball> {
    let mut balls: Vec<Ball> = Vec::with_capacity(count);
    for _ in 0..count * 200 {
        if balls.len() == count {
            break;
        }
        let radius = rng.random_range(0.15..0.5);
        let (sine, cosine) = (TAU * rng.random::<f64>()).sin_cos();
        let r = 1.9 * rng.random::<f64>().sqrt();
        let centre = Point::new(r * cosine, r * sine, rng.random_range(0.3..2.8));
        let apart = balls
            .iter()
            .all(|b| (b.centre - centre).norm() >= b.radius + radius);
        if centre.norm() >= radius + 0.45 && apart {
            balls.push(Ball { centre, radius });
        }
    }
    balls
}

fn draw_tip(robot: &UnitRobot, scene: &Scene, rng: &mut Pcg64) -> Option<(Configuration, Point)> {
    let shape = random_configuration(robot, rng);
    let tip = robot.tip(&shape);
    (in_workspace(&tip) && is_clear(robot, scene, &shape)).then_some((shape, tip))
}

/// Whether targets and starts may have their tip there.
pub(crate) fn in_workspace(tip: &Point) -> bool {
    WORKSPACE_RADII.contains(&tip.x.hypot(tip.y)) && WORKSPACE_HEIGHTS.contains(&tip.z)
}

fn is_clear(robot: &UnitRobot, scene: &Scene, shape: &Configuration) -> bool {
    scene.clearance_at(robot, shape) >= ENDPOINT_CLEARANCE
}

fn draw_starts(
    robot: &UnitRobot,
    scene: &Scene,
    target: &Point,
    rng: &mut Pcg64,
) -> Vec<Configuration> {
    let straight = Configuration::zeros();
    let mut starts: Vec<Configuration> = Vec::with_capacity(STARTS);
    if is_clear(robot, scene, &straight) && (robot.tip(&straight) - target).norm() >= 0.6 {
        starts.push(straight);
    }
    for _ in 0..400 {
        if starts.len() == STARTS {
            break;
        }
        let shape = random_configuration(robot, rng);
        let tip = robot.tip(&shape);
        let away = (tip - target).norm() >= 0.6 && shape.norm() >= 0.5;
        let distinct = starts.iter().all(|s| (s - shape).norm() >= 0.5);
        if away && distinct && in_workspace(&tip) && is_clear(robot, scene, &shape) {
            starts.push(shape);
        }
    }
    starts
}

fn is_hard(
    robot: &UnitRobot,
    scene: &Scene,
    tip: &Point,
    start: &Configuration,
    rng: &mut Pcg64,
) -> bool {
    let problem = Problem {
        start: *start,
        goal: Goal::Tip(*tip),
        scene: scene.clone(),
        moving: MovingObstacles::default(),
    };
    let Ok(ends) = goal_configurations(robot, &problem, 10, rng) else {
        return false;
    };
    let free =
        |end: &&Configuration| certify_polyline(robot, scene, &straight_path(start, end)).is_free();
    let straight_ones = ends.iter().filter(free).count();
    straight_ones * 10 <= ends.len()
        && rrt_connect(
            robot,
            scene,
            start,
            &ends,
            &RrtSettings::default(),
            rng,
            &|| false,
        )
        .is_some()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::unit_robot;

    #[test]
    fn targets_repeat_by_seed_and_index_alone() {
        let robot = unit_robot();
        let draw = |index| {
            draw_target(&robot, Setting::General(Some(3)), 5, index).map(|t| (t.tip, t.starts))
        };
        assert_eq!(draw(3), draw(3));
        assert_ne!(draw(3), draw(4));
    }

    #[test]
    fn drawn_starts_and_targets_keep_the_promised_distances() {
        let robot = unit_robot();
        let targets: Vec<Target> = (0..32)
            .filter_map(|i| draw_target(&robot, Setting::General(None), 1, i))
            .collect();
        assert!(targets.len() > 16);
        for target in &targets {
            for start in &target.starts {
                assert!((robot.tip(start) - target.tip).norm() >= 0.6);
                assert!(is_clear(&robot, &target.scene, start));
            }
        }
    }
}
