//! The obstacles: balls, behind a bounding-volume tree where there are many, and solids.

use crate::solid::Solid;
use glam::DVec3;
use parry3d_f64::bounding_volume::{Aabb, BoundingVolume};
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy};
use pcc_model::Point;
use std::sync::Arc;
use thiserror::Error;

/// Balls a scene may hold: those of a static scene, and those of a request or a live scene.
pub const MAX_BALLS: usize = 2048;
/// Solids a scene may hold.
pub const MAX_SOLIDS: usize = 256;
/// Largest coordinate and radius of a ball, length unit: beyond it clearances lose more digits than a motion has room.
pub const MAX_EXTENT: f64 = 1e7;
/// Up to this many balls a plain scan is faster than the tree.
const SCAN_UP_TO: usize = 256;

/// A ball.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// Centre, base frame.
    pub centre: Point,
    /// Radius.
    pub radius: f64,
}

/// Why obstacles do not make a scene.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum SceneError {
    /// Too many balls.
    #[error("{count} balls; at most {MAX_BALLS} are allowed")]
    Count {
        /// How many there were.
        count: usize,
    },
    /// Too many solids.
    #[error("{count} solids; at most {MAX_SOLIDS} are allowed")]
    Solids {
        /// How many there were.
        count: usize,
    },
    /// A centre or a radius is not usable.
    #[error(
        "ball {index} has centre {centre:?} and radius {radius}; coordinates within ±{MAX_EXTENT:e} and a radius of 0 to {MAX_EXTENT:e} are allowed"
    )]
    Ball {
        /// Index of the ball.
        index: usize,
        /// Its centre.
        centre: [f64; 3],
        /// Its radius.
        radius: f64,
    },
}

/// A set of obstacles that answers questions about the space around them.
///
/// Distances to balls are exact. Those to solids are never above the true ones, and below them by at most 1e-3 of the
/// section's length and a twentieth of the clearance.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    balls: Vec<Ball>,
    solids: Vec<Arc<Solid>>,
    smallest_radius: f64,
    largest_radius: f64,
    tree: Option<Bvh>,
}

impl Scene {
    /// Makes a scene of balls.
    ///
    /// # Errors
    /// [`SceneError`], naming the ball and what is allowed.
    pub fn new(balls: Vec<Ball>) -> Result<Self, SceneError> {
        Self::with_solids(balls, Vec::new())
    }

    /// Makes a scene of balls and solids.
    ///
    /// # Errors
    /// [`SceneError`], naming the ball and what is allowed.
    pub fn with_solids(balls: Vec<Ball>, solids: Vec<Arc<Solid>>) -> Result<Self, SceneError> {
        if solids.len() > MAX_SOLIDS {
            return Err(SceneError::Solids {
                count: solids.len(),
            });
        }
        if balls.len() > MAX_BALLS {
            return Err(SceneError::Count { count: balls.len() });
        }
        if let Some(index) = balls.iter().position(|ball| !is_allowed(ball)) {
            return Err(SceneError::Ball {
                index,
                centre: balls[index].centre.into(),
                radius: balls[index].radius,
            });
        }
        let tree = (balls.len() > SCAN_UP_TO).then(|| {
            let boxes: Vec<Aabb> = balls.iter().map(|b| cube(&b.centre, b.radius)).collect();
            Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes)
        });
        let radii = || balls.iter().map(|b| b.radius);
        let largest_radius = radii().fold(0.0, f64::max);
        let smallest_radius = match solids.is_empty() {
            true => radii().fold(largest_radius, f64::min),
            false => 0.0,
        };
        Ok(Self {
            balls,
            solids,
            smallest_radius,
            largest_radius,
            tree,
        })
    }

    /// The balls, in the order given.
    #[must_use]
    pub fn balls(&self) -> &[Ball] {
        &self.balls
    }

    /// The solids, in the order given.
    #[must_use]
    pub fn solids(&self) -> &[Arc<Solid>] {
        &self.solids
    }

    /// The same obstacles, after these balls.
    ///
    /// # Errors
    /// [`SceneError`], if there are too many together or one of these is not usable.
    pub fn with_balls(&self, mut balls: Vec<Ball>) -> Result<Self, SceneError> {
        balls.extend(&self.balls);
        Self::with_solids(balls, self.solids.clone())
    }

    /// Whether there are no obstacles.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.balls.is_empty() && self.solids.is_empty()
    }

    /// Least radius of all obstacles: that of the smallest ball; 0 where there is a solid, which may have corners.
    pub(crate) fn smallest_radius(&self) -> f64 {
        self.smallest_radius
    }

    /// Whether the balls are many, so that a query gains by more and closer `places`.
    pub(crate) fn has_many_balls(&self) -> bool {
        self.tree.is_some()
    }

    /// Index and cost of the ball of least `cost`, if there is any ball.
    ///
    /// `cost` must be at least the signed distance from the nearest of the places to the ball's surface minus `reach`: the
    /// balls for which that exceeds the least cost found are passed over.
    pub(crate) fn least<const N: usize>(
        &self,
        places: &[Point; N],
        reach: f64,
        cost: impl Fn(&Ball) -> f64,
    ) -> Option<(usize, f64)> {
        match &self.tree {
            None => self.least_by_scan(places, reach, cost),
            Some(tree) => {
                let deepest = -self.largest_radius;
                let node_cost = |gap: f64| if gap > 0.0 { gap } else { deepest } - reach;
                tree.find_best(
                    f64::MAX,
                    |node, _| node_cost(gap_to_box(places, &node.aabb())),
                    |i, best| {
                        let ball = &self.balls[i as usize];
                        is_within(ball, places, best + reach).then(|| cost(ball))
                    },
                )
                .map(|(i, least)| (i as usize, least))
            }
        }
    }

    fn least_by_scan<const N: usize>(
        &self,
        places: &[Point; N],
        reach: f64,
        cost: impl Fn(&Ball) -> f64,
    ) -> Option<(usize, f64)> {
        let mut least: Option<(usize, f64)> = None;
        for (i, ball) in self.balls.iter().enumerate() {
            if least.is_none_or(|(_, best)| is_within(ball, places, best + reach)) {
                let cost = cost(ball);
                if least.is_none_or(|(_, best)| cost < best) {
                    least = Some((i, cost));
                }
            }
        }
        least
    }

    /// Calls `visit` with every ball whose surface comes within `reach` of one of the places.
    pub(crate) fn for_each_near<const N: usize>(
        &self,
        places: &[Point; N],
        reach: f64,
        mut visit: impl FnMut(usize, &Ball),
    ) {
        let mut visit_near = |(i, ball): (usize, &Ball)| {
            if is_within(ball, places, reach) {
                visit(i, ball);
            }
        };
        match &self.tree {
            None => self.balls.iter().enumerate().for_each(visit_near),
            Some(tree) => {
                let around = places.iter().map(|place| DVec3::from(*place));
                let aabb = Aabb::from_points(around).loosened(reach.max(0.0));
                tree.intersect_aabb(&aabb)
                    .for_each(|i| visit_near((i as usize, &self.balls[i as usize])));
            }
        }
    }
}

fn is_allowed(ball: &Ball) -> bool {
    ball.centre.iter().all(|v| v.abs() <= MAX_EXTENT) && (0.0..=MAX_EXTENT).contains(&ball.radius)
}

/// Whether a ball's surface is nearer than `reach` to one of the places; without a square root.
fn is_within<const N: usize>(ball: &Ball, places: &[Point; N], reach: f64) -> bool {
    let limit = reach + ball.radius;
    let is_near = |place: &Point| (ball.centre - place).norm_squared() < limit * limit;
    limit > 0.0 && places.iter().any(is_near)
}

fn gap_to_box<const N: usize>(places: &[Point; N], aabb: &Aabb) -> f64 {
    let gap = |place: &Point| {
        let from = DVec3::from(*place);
        (from.clamp(aabb.mins, aabb.maxs) - from).length_squared()
    };
    places.iter().map(gap).fold(f64::INFINITY, f64::min).sqrt()
}

fn cube(centre: &Point, half: f64) -> Aabb {
    let (c, h) = (DVec3::from(*centre), DVec3::splat(half));
    Aabb::new(c - h, c + h)
}
