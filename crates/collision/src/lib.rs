//! Scenes of balls and solids, the clearance of a robot's body, and certificates for whole motions.
//!
//! Lengths have the unit of the robot's section lengths; positions are in the robot's base frame. The body is a tube
//! of constant radius around the backbone, so clearances to balls are exact (docs/robot.md "Exact geometry of a section").
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod arc_search;
mod ball;
mod ball_groups;
mod ball_tree;
mod body_state;
mod bound;
mod certificate;
mod chain;
mod chosen_sections;
mod clearance;
mod closed_mesh;
mod edge;
mod file_error;
mod limits;
mod mesh_files;
mod minimum;
mod moving;
mod passage;
mod relevant;
mod remaining_pieces;
mod scene;
mod scene_file;
mod solid;
mod solid_error;
mod solid_files;
mod verdict;
mod voxels;

pub use ball::Ball;
pub use bound::{Displacement, tracking_growth};
pub use certificate::{certify_polyline, certify_trajectory};
pub use clearance::Contact;
pub use edge::certify_edge;
pub use file_error::{EntryError, SceneFileError};
pub use limits::{MAX_CELLS, MAX_EXTENT, MAX_TRIANGLES};
pub use minimum::{certified_clearance, minimum_clearance};
pub use moving::{MovingBall, certify_moving, certify_moving_until};
pub use scene::{MAX_BALLS, MAX_SOLIDS, Scene, SceneError};
pub use solid::{Solid, SurfacePoint};
pub use solid_error::SolidError;
pub use verdict::Verdict;
pub use voxels::{VoxelError, VoxelGrid};
