//! Scenes of balls and solids, the clearance of a robot's body, and certificates for whole motions.
//!
//! Lengths have the unit of the robot's section lengths; positions are in the robot's base frame. The body is a tube
//! of constant radius around the backbone, so clearances to balls are exact (docs/robot.md "Exact geometry of a section").
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod arc_search;
mod ball_groups;
mod ball_tree;
mod bound;
mod certificate;
mod chain;
mod clearance;
mod edge;
mod mesh_files;
mod minimum;
mod moving;
mod relevant;
mod scene;
mod scene_file;
mod solid;
mod solid_files;
mod voxels;

pub use bound::{Displacement, tracking_growth};
pub use certificate::{certify_polyline, certify_trajectory};
pub use chain::Verdict;
pub use clearance::Contact;
pub use edge::certify_edge;
pub use minimum::{certified_clearance, minimum_clearance};
pub use moving::{MovingBall, certify_moving, certify_moving_until};
pub use scene::{Ball, MAX_BALLS, MAX_EXTENT, MAX_SOLIDS, Scene, SceneError};
pub use scene_file::{EntryError, SceneFileError};
pub use solid::{MAX_TRIANGLES, Solid, SolidError, SurfacePoint};
pub use voxels::{MAX_CELLS, VoxelError, VoxelGrid};
