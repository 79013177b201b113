//! Motion planning for three-section continuum robots: a request becomes certified, timed candidates.
//!
//! Lengths are in units of one section's arc length, angles in radians, and every position is in the robot's
//! base frame. The stages of [`Planner::plan`] are: end shapes by analytic inverse kinematics, paths from a
//! learned sampler (or straight ones, or a tree), analytic correction, time allocation, certification of the
//! executed curve, selection.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod along_polyline;
mod answer;
mod braking;
mod canonical;
mod cholesky;
mod constraints;
mod context;
mod correction;
mod default;
mod diffusion;
mod edges;
mod end_shapes;
mod error;
mod exploring;
mod fast;
mod features;
mod first_success;
mod first_way;
#[cfg(test)]
mod fixtures;
mod goal_set;
mod incumbent;
mod inverse_kinematics;
mod known_ways;
mod learned;
mod least_duration;
mod metrics;
mod neighbours;
mod newton;
mod path;
mod path_to_trajectory;
mod pen;
mod plan;
mod planner;
mod previous;
mod problem;
mod pushes;
mod race;
mod random_configuration;
mod reach;
mod request;
mod resources;
mod rrt_connect;
pub mod sampled_collision;
mod sampling;
mod select;
mod sharpen;
mod shortcut;
mod sine_basis;
mod smooth_least_squares;
mod smoothing;
mod stage_times;
mod straighten;
mod terminal;
mod tree;
mod trees;
mod whole_paths;

pub use correction::limit_pushes;
pub use denoiser::FeatureFrame;
pub use diffusion::{DiffusionModel, DiffusionSettings, PrecisionUnavailable};
pub use edges::RrtSettings;
pub use end_shapes::{EndShapes, end_shapes};
pub use error::{Infeasible, PlannerError};
pub use features::{BALL_FEATURES, COEFFICIENTS, END_FEATURES, features, residual_coefficients};
pub use inverse_kinematics::solve_tip;
pub use metrics::{PathMetrics, SetMetrics, modes, path_metrics, set_metrics};
pub use path::{WAYPOINTS, Waypoints, parameter, project_to_limits, resample, straight_path};
pub use path_to_trajectory::MOST_CORRECTIONS;
pub use plan::{Candidate, Certified, Draw, Failure, Plan, Source};
pub use planner::Planner;
pub use problem::{Goal, Problem};
pub use random_configuration::random_configuration;
pub use request::{Guidance, PreviousPlan, Request, Sampler, Selection, StartMotion, Supervision};
pub use resources::Models;
pub use rrt_connect::rrt_connect;
pub use sampled_collision::SampledVerdict;
pub use select::select;
pub use sine_basis::SineBasis;
pub use smooth_least_squares::SmoothLeastSquares;
pub use stage_times::StageTimes;
