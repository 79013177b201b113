//! The obstacles: balls, behind a bounding-volume tree where there are many, and solids.

use crate::distance::arc_balls::BallGroups;
use crate::distance::ball_tree::BallTree;
use crate::distance::chosen_sections::Chosen;
use crate::obstacle::ball::Ball;
use crate::obstacle::limits::MAX_EXTENT;
use crate::obstacle::solid::Solid;
use pcc_model::{Backbone, SECTIONS};
use std::sync::Arc;
use thiserror::Error;

/// Balls a scene may hold: those of a file, of a request and of four live scenes together.
pub const MAX_BALLS: usize = 8192;
/// Solids a scene may hold.
pub const MAX_SOLIDS: usize = 256;
/// Up to this many balls are all measured, in groups; of more a tree finds those that are near.
const GROUPED_UP_TO: usize = 256;

/// Why obstacles do not make a scene.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum SceneError {
    /// Too many balls.
    #[error("{count} balls; at most {MAX_BALLS} are allowed")]
    Count {
        /// Number of balls.
        count: usize,
    },
    /// Too many solids.
    #[error("{count} solids; at most {MAX_SOLIDS} are allowed")]
    Solids {
        /// Number of solids.
        count: usize,
    },
    /// A centre or a radius is not usable.
    #[error(
        "ball {index} has centre {centre:?} and radius {radius}; coordinates within ±{MAX_EXTENT:e} and a radius of 0 to {MAX_EXTENT:e} are allowed"
    )]
    Ball {
        /// Index of the ball.
        index: usize,
        /// The ball's centre.
        centre: [f64; 3],
        /// The ball's radius.
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
    finder: Finder,
}

/// The structure that finds the balls near a section.
#[derive(Clone, Debug)]
enum Finder {
    Groups(BallGroups),
    Tree(BallTree),
}

impl Default for Finder {
    fn default() -> Self {
        Self::Groups(BallGroups::default())
    }
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
        if let Some(index) = balls.iter().position(|ball| !ball.is_allowed()) {
            return Err(SceneError::Ball {
                index,
                centre: balls[index].centre.into(),
                radius: balls[index].radius,
            });
        }
        let finder = if balls.len() > GROUPED_UP_TO {
            Finder::Tree(BallTree::of(&balls))
        } else {
            Finder::Groups(BallGroups::of(&balls))
        };
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
            finder,
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

    /// A scene of `balls`, followed by the obstacles of this one.
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

    /// Distance from each chosen section's backbone to the nearest ball; +∞ for the others, and without balls.
    pub(crate) fn nearest_balls(&self, backbone: &Backbone, chosen: &Chosen) -> [f64; SECTIONS] {
        match &self.finder {
            Finder::Groups(groups) => groups.nearest(backbone, chosen),
            Finder::Tree(tree) => tree.nearest(&self.balls, backbone, chosen),
        }
    }

    /// Calls `visit` with every section and the index of every ball that is nearer to its backbone than its reach.
    pub(crate) fn for_each_ball_within(
        &self,
        backbone: &Backbone,
        reaches: &[f64; SECTIONS],
        visit: impl FnMut(usize, usize),
    ) {
        match &self.finder {
            Finder::Groups(groups) => groups.for_each_within(backbone, reaches, visit),
            Finder::Tree(tree) => tree.for_each_within(&self.balls, backbone, reaches, visit),
        }
    }
}
