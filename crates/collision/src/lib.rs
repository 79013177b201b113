//! Scenes of balls and solids, the clearance of a robot's body, and certificates for whole motions.
//!
//! Lengths have the unit of the robot's section lengths; positions are in the robot's base frame. The body is a tube
//! of constant radius around the backbone, so clearances to balls are exact (docs/robot.md "Exact geometry of a section").
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod certify;
mod distance;
mod obstacle;
mod scene;

pub use certify::edge::certify_edge;
pub use certify::minimum::{certified_clearance, minimum_clearance};
pub use certify::motion_bound::tracking_padding;
pub use certify::moving_ball_cover::{Cover, TimeSpread};
pub use certify::moving_balls::{MovingBall, certify_moving};
pub use certify::trajectory::{certify_polyline, certify_trajectory};
pub use certify::verdict::Verdict;
pub use obstacle::ball::Ball;
pub use obstacle::limits::{MAX_CELLS, MAX_EXTENT, MAX_TRIANGLES};
pub use obstacle::solid::{Solid, SurfacePoint};
pub use obstacle::solid_error::SolidError;
pub use obstacle::voxel_grid::{VoxelError, VoxelGrid};
pub use scene::clearance::Contact;
pub use scene::file_error::{EntryError, SceneFileError};
pub use scene::static_scene::{MAX_BALLS, MAX_SOLIDS, Scene, SceneError};
