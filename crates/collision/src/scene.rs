//! The obstacles: balls, behind a bounding-volume tree where there are many.

use glam::DVec3;
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy};
use pcc_model::Point;
use thiserror::Error;

/// Balls a scene may hold.
pub const MAX_BALLS: usize = 1024;
/// Up to this many balls a plain scan is faster than the tree.
const SCAN_UP_TO: usize = 16;

/// A ball.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// Centre, base frame.
    pub centre: Point,
    /// Radius.
    pub radius: f64,
}

/// Why balls do not make a scene.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum SceneError {
    /// Too many balls.
    #[error("{count} balls; at most {MAX_BALLS} are allowed")]
    Count {
        /// How many there were.
        count: usize,
    },
    /// A centre or a radius is not usable.
    #[error(
        "ball {index} has centre {centre:?} and radius {radius}; a finite centre and a finite radius of at least 0 are allowed"
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

/// A set of balls that answers questions about the space around them.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    balls: Vec<Ball>,
    tree: Option<Bvh>,
}

impl Scene {
    /// Makes a scene.
    ///
    /// # Errors
    /// [`SceneError`], naming the ball and what is allowed.
    pub fn new(balls: Vec<Ball>) -> Result<Self, SceneError> {
        if balls.len() > MAX_BALLS {
            return Err(SceneError::Count { count: balls.len() });
        }
        for (index, b) in balls.iter().enumerate() {
            if !(b.centre.iter().all(|v| v.is_finite()) && b.radius.is_finite() && b.radius >= 0.0)
            {
                return Err(SceneError::Ball {
                    index,
                    centre: b.centre.into(),
                    radius: b.radius,
                });
            }
        }
        let tree = (balls.len() > SCAN_UP_TO).then(|| {
            let boxes: Vec<Aabb> = balls.iter().map(|b| cube(&b.centre, b.radius)).collect();
            Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes)
        });
        Ok(Self { balls, tree })
    }

    /// The balls, in the order given.
    #[must_use]
    pub fn balls(&self) -> &[Ball] {
        &self.balls
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.balls.is_empty()
    }

    /// Whether the scene is large enough to be searched through the tree.
    pub(crate) fn is_large(&self) -> bool {
        self.tree.is_some()
    }

    /// Calls `visit` with every ball that comes within `reach` of `centre` (and possibly some others).
    pub(crate) fn for_each_near(
        &self,
        centre: &Point,
        reach: f64,
        mut visit: impl FnMut(usize, &Ball),
    ) {
        match &self.tree {
            None => self.balls.iter().enumerate().for_each(|(i, b)| visit(i, b)),
            Some(tree) => {
                let region = cube(centre, reach);
                tree.intersect_aabb(&region)
                    .for_each(|i| visit(i as usize, &self.balls[i as usize]));
            }
        }
    }
}

fn cube(centre: &Point, half: f64) -> Aabb {
    let (c, h) = (DVec3::from(*centre), DVec3::splat(half));
    Aabb::new(c - h, c + h)
}
