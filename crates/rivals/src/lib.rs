//! The planners that the paper compares its own with, as it set them (docs/evaluation.md "The paper's rivals"): RRT and RRT* in
//! configuration space and on tip positions, and an artificial potential field; and RRT* and BIT* as an expert would set them.
//!
//! The paper's look at nine points of the body in nodes and waypoints alone, as its criterion does, and nothing of theirs is certified
//! here; the expert's ([`Anytime`]) have certified edges.
//! Lengths are in units of one section's arc length, angles in radians, and positions in the robot's base frame.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod anytime;
#[cfg(test)]
mod fixtures;
mod potential_field;
mod query;
mod tip_spacing;
mod tree;

pub use anytime::Anytime;
pub use query::Query;

use datasets::reference::{PathMaker, Surroundings};
use planning::Waypoints;
use rand_pcg::Pcg64;
use tree::{Growth, Space};

/// A planner of the paper's comparison.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rival {
    /// RRT in configuration space.
    CRrt,
    /// RRT* in configuration space; costs are tip lengths.
    CRrtStar,
    /// RRT on tip positions, with inverse kinematics from each node's parent.
    WRrt,
    /// RRT* on tip positions, likewise.
    WRrtStar,
    /// The straight tip path to one goal configuration, pushed out of the balls.
    Apf,
}

impl Rival {
    /// One attempt: a path of 64 waypoints, which may collide between the nodes that were looked at; none where none was found.
    pub fn attempt(self, query: &Query, rng: &mut Pcg64) -> Option<Waypoints> {
        let place = Surroundings::new(query.robot, query.balls);
        match self {
            Self::CRrt => configuration_tree(query, &place, Growth::First, rng),
            Self::CRrtStar => configuration_tree(query, &place, Growth::Shortest, rng),
            Self::WRrt => tree::grow(query, &place, Space::Tip, Growth::First, rng),
            Self::WRrtStar => tree::grow(query, &place, Space::Tip, Growth::Shortest, rng),
            Self::Apf => {
                potential_field::path(query, &place, &mut PathMaker::new(query.robot), rng)
            }
        }
    }
}

/// A tree towards one goal configuration, from one random seed; none where that does not come to the target clear of the balls.
fn configuration_tree(
    query: &Query,
    place: &Surroundings,
    growth: Growth,
    rng: &mut Pcg64,
) -> Option<Waypoints> {
    let seed = planning::random_configuration(query.robot, rng);
    let goal = place.reach(&query.target, &seed)?;
    let is_clear = place.clearance(&goal) >= 0.0;
    is_clear.then(|| tree::grow(query, place, Space::Configuration { goal }, growth, rng))?
}
