//! Bringing the tip of a path onto a curve by Newton steps, where the body has room.

use crate::goals::newton::{
    Configurations, Jacobians, Points, bending_squares, beyond_limits, damped_steps, within_limits,
};
use crate::path::waypoints::{WAYPOINTS, WaypointArray};
use collision::Scene;
use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch, mask64x4};
use pcc_model::{Configuration, LANES, Point, UnitRobot, norms_squared, one_by_one, side_by_side};
use std::array;

/// Step between the waypoints that are tried first: most curves that do not serve show it there. Even, so that these are odd ones.
const STRIDE: usize = 8;
/// How many waypoints are tried first.
const FIRST: usize = WAYPOINTS / STRIDE;
const _: () = assert!(FIRST * STRIDE == WAYPOINTS && STRIDE.is_multiple_of(2));
/// Waypoints with odd numbers, without the last; as many have even ones, without the first.
const HALF: usize = WAYPOINTS / 2 - 1;
/// Newton steps at most: a count, so that answers do not depend on time.
const STEPS: usize = 4;
/// A tip this near to the curve is on it, section lengths.
const ON_THE_CURVE: f64 = 1e-6;
/// How far the curve may be from the tip of a first guess, section lengths.
const NEAR: f64 = 0.5;
/// A waypoint that would have to move farther lies near a configuration whose tip cannot follow the curve, rad.
const LARGEST_CHANGE_RAD: f64 = 0.8;
/// Weight of a section at its limit in a Newton step; a straight one has 1.
const LEAST_WEIGHT: f64 = 0.02;

/// Waypoints whose tips are brought onto the curve together.
type Four = [Configuration; LANES];

/// How closely a tip must follow its curve.
pub(super) struct TipDemand {
    /// A direction (length one) in which the tip may be anywhere, if there is one.
    pub(super) loose: Option<Point>,
    /// Whether steps that would bend beyond the limits fail; else they are cut there.
    pub(super) keeps_limits: bool,
}

/// Brings tips onto curves where the body has room.
pub(super) struct TipTracker<'a> {
    pub(crate) robot: &'a UnitRobot,
    pub(crate) scene: &'a Scene,
    /// Clearance to keep beyond the tube, section lengths.
    pub(crate) margin: f64,
    pub(crate) ends: [Configuration; 2],
}

impl TipTracker<'_> {
    /// The path between the ends whose tip is on the curve, near a first guess; none where that is too far away or too near
    /// to an obstacle.
    pub(super) fn track(
        &self,
        demand: &TipDemand,
        guess: impl Fn(usize) -> Configuration,
        curve: impl Fn(usize) -> Point,
    ) -> Option<WaypointArray> {
        let mut tracked = [Configuration::zeros(); WAYPOINTS];
        (tracked[0], tracked[WAYPOINTS - 1]) = (self.ends[0], self.ends[1]);
        // 1, 9, …, 57, 3, 11, …
        let odd: [usize; HALF] = array::from_fn(|i| 1 + i / FIRST * 2 + i % FIRST * STRIDE);
        for some in odd.chunks(LANES) {
            let configurations =
                self.waypoints(demand, &four(some, &guess), &four(some, &curve))?;
            put(&mut tracked, some, &configurations);
        }
        let even: [usize; HALF] = array::from_fn(|i| 2 * i + 2);
        for some in even.chunks(LANES) {
            let near = four(some, |h| interpolated(&tracked, h));
            let configurations = self.between(demand, &near, &four(some, &curve))?;
            put(&mut tracked, some, &configurations);
        }
        Some(tracked)
    }

    /// Configurations whose tips are all but on the curve, moved onto it by one Newton step; none where the step fails.
    fn between(&self, demand: &TipDemand, near: &Four, places: &[Point; LANES]) -> Option<Four> {
        dispatch!(Level::new(), simd => {
            let (configurations, places) = (side_by_side(simd, near), side_by_side(simd, places));
            let (jacobians, errors) = self.demanded(demand, &configurations, &places);
            let (next, fails) = self.step(demand, &configurations, &jacobians, &errors);
            if fails.any_true() { None } else { Some(one_by_one(&next)) }
        })
    }

    /// The configurations near these guesses whose tips are at `places`; none where one is too far from its guess, or its body too near to
    /// an obstacle.
    fn waypoints(
        &self,
        demand: &TipDemand,
        guesses: &Four,
        places: &[Point; LANES],
    ) -> Option<Four> {
        let configurations =
            dispatch!(Level::new(), simd => self.converge(simd, demand, guesses, places))?;
        let serves = |(configuration, guess): (&Configuration, &Configuration)| {
            let is_near = (configuration - guess).norm() <= LARGEST_CHANGE_RAD;
            is_near && self.scene.clearance_at(self.robot, configuration) >= self.margin
        };
        configurations
            .iter()
            .zip(guesses)
            .all(serves)
            .then_some(configurations)
    }

    /// The configurations after Newton steps; none where a place is too far away, or a step fails.
    #[inline(always)]
    fn converge<S: Simd>(
        &self,
        simd: S,
        demand: &TipDemand,
        guesses: &Four,
        places: &[Point; LANES],
    ) -> Option<Four> {
        let (mut configurations, places) =
            (side_by_side(simd, guesses), side_by_side(simd, places));
        for taken in 0..STEPS {
            let (jacobians, errors) = self.demanded(demand, &configurations, &places);
            let squares = norms_squared(&errors);
            if taken == 0 && !squares.simd_le(NEAR * NEAR).all_true() {
                return None;
            }
            let moving = squares.simd_ge(ON_THE_CURVE * ON_THE_CURVE);
            if !moving.any_true() {
                break;
            }
            let (next, fails) = self.step(demand, &configurations, &jacobians, &errors);
            if (fails & moving).any_true() {
                return None;
            }
            for (configuration, next) in configurations.iter_mut().zip(next) {
                *configuration = moving.select(next, *configuration);
            }
        }
        Some(one_by_one(&configurations))
    }

    /// The tips' Jacobians, and the vectors from the tips to their places, both without the direction in which the tip is loose.
    #[inline(always)]
    fn demanded<S: Simd>(
        &self,
        demand: &TipDemand,
        configurations: &Configurations<S>,
        places: &Points<S>,
    ) -> (Jacobians<S>, Points<S>) {
        let tips = self.robot.moving_tips(configurations);
        let (mut jacobians, mut errors) = (tips.jacobians, *places);
        for (error, position) in errors.iter_mut().zip(tips.positions) {
            *error -= position;
        }
        if let Some(loose) = &demand.loose {
            remove(loose, &mut errors);
            for column in &mut jacobians {
                remove(loose, column);
            }
        }
        (jacobians, errors)
    }

    /// The configurations within the limits after a Newton step that moves the tips by `errors`, of least norm where sections near
    /// their limits weigh more (Chan and Dubey 1995), and the lanes for which there is none.
    #[inline(always)]
    fn step<S: Simd>(
        &self,
        demand: &TipDemand,
        configurations: &Configurations<S>,
        jacobians: &Jacobians<S>,
        errors: &Points<S>,
    ) -> (Configurations<S>, mask64x4<S>) {
        let per_square = self.robot.bending_limit.powi(-2);
        let mut free = bending_squares(configurations);
        for part in &mut free {
            *part = (1.0 - *part * per_square).max(LEAST_WEIGHT);
        }
        let (mut next, solvable) = damped_steps(jacobians, &free, errors);
        for (next, from) in next.iter_mut().zip(configurations) {
            *next += *from;
        }
        if demand.keeps_limits {
            (next, !solvable | beyond_limits(self.robot, &next))
        } else {
            (within_limits(self.robot, &next), !solvable)
        }
    }
}

/// Removes from vectors their components in a direction.
#[inline(always)]
fn remove<S: Simd>(direction: &Point, vectors: &mut Points<S>) {
    let [x, y, z] = *vectors;
    let along = x * direction.x + y * direction.y + z * direction.z;
    for (vector, part) in vectors.iter_mut().zip(direction.iter()) {
        *vector -= along * *part;
    }
}

/// The values `of` up to four waypoints; the last one is repeated where there are fewer.
fn four<T>(some: &[usize], of: impl Fn(usize) -> T) -> [T; LANES] {
    array::from_fn(|lane| of(some[lane.min(some.len() - 1)]))
}

fn put(tracked: &mut WaypointArray, some: &[usize], configurations: &Four) {
    for (h, configuration) in some.iter().zip(configurations) {
        tracked[*h] = *configuration;
    }
}

/// The cubic through the nearest configurations with odd numbers, and the ends, at an even one.
fn interpolated(tracked: &WaypointArray, h: usize) -> Configuration {
    let nodes = match h {
        2 => [0, 1, 3, 5],
        _ if h == WAYPOINTS - 2 => [7, 5, 3, 1].map(|before| WAYPOINTS - before),
        _ => [h - 3, h - 1, h + 1, h + 3],
    };
    let weight = |node: usize| -> f64 {
        let others = nodes.iter().filter(|&&other| other != node);
        let parts = others.map(|&other| (h as f64 - other as f64) / (node as f64 - other as f64));
        parts.product()
    };
    nodes.iter().map(|&node| tracked[node] * weight(node)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::unit_robot;
    use crate::search::random_configuration::random_configuration;
    use rand::SeedableRng;

    #[test]
    fn a_waypoint_is_tracked_as_it_is_alone() {
        let (robot, scene) = (unit_robot(), Scene::default());
        let tracker = TipTracker {
            robot: &robot,
            scene: &scene,
            margin: 0.0,
            ends: [Configuration::zeros(); 2],
        };
        let mut rng = rand_pcg::Pcg64::seed_from_u64(6);
        let (mut tracked, mut failed) = (0, 0);
        for loose in [None, Some(Point::x())] {
            for keeps_limits in [false, true] {
                let demand = TipDemand {
                    loose,
                    keeps_limits,
                };
                for _ in 0..200 {
                    let guesses: Four = array::from_fn(|_| random_configuration(&robot, &mut rng));
                    // One is on its place already, and one twice as far from it as the others.
                    let away = |lane| Point::new(0.0, 0.02, -0.04) * [1.0, 0.0, 2.0, 1.0][lane];
                    let places = array::from_fn(|lane| robot.tip(&guesses[lane]) + away(lane));
                    let together = tracker.waypoints(&demand, &guesses, &places);
                    let alone = |lane: usize| {
                        tracker.waypoints(&demand, &[guesses[lane]; LANES], &[places[lane]; LANES])
                    };
                    let alone: Vec<Option<Four>> = (0..LANES).map(alone).collect();
                    if let Some(together) = together {
                        tracked += 1;
                        for (lane, alone) in alone.iter().enumerate() {
                            assert_eq!(Some([together[lane]; LANES]), *alone);
                        }
                    } else {
                        failed += 1;
                        assert!(alone.contains(&None));
                    }
                }
            }
        }
        assert!(
            tracked > 100 && failed > 20,
            "{tracked} tracked, {failed} failed"
        );
    }

    #[test]
    fn a_place_that_is_not_a_number_is_not_tracked() {
        let (robot, scene) = (unit_robot(), Scene::default());
        let ends = [Configuration::repeat(0.2), Configuration::repeat(0.3)];
        let tracker = TipTracker {
            robot: &robot,
            scene: &scene,
            margin: 0.0,
            ends,
        };
        let demand = TipDemand {
            loose: None,
            keeps_limits: true,
        };
        for unknown in [2, 9, 61] {
            let curve = |h: usize| {
                let place = robot.tip(&Configuration::repeat(0.2));
                if h == unknown {
                    place * f64::NAN
                } else {
                    place
                }
            };
            let guess = |_| Configuration::repeat(0.2);
            assert!(tracker.track(&demand, guess, curve).is_none(), "{unknown}");
        }
        let still = |_| robot.tip(&Configuration::repeat(0.2));
        assert!(tracker.track(&demand, |_| ends[0], still).is_some());
    }
}
