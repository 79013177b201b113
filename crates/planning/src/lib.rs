//! Motion planning for three-section continuum robots: a request becomes certified, timed candidates.
//!
//! Lengths are in units of one section's arc length, angles in radians, and every position is in the robot's
//! base frame. The stages of [`Planner::plan`] are: goal configurations by analytic inverse kinematics, paths from a
//! learned sampler (or straight ones, or a tree), analytic correction, time parameterization, certification of the
//! executed curve; [`select`] chooses among the candidates.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod error;
#[cfg(test)]
mod fixtures;
mod goals;
mod models;
mod motion;
mod moving_obstacles;
mod optimize;
mod path;
mod pipeline;
mod plan;
mod planner;
mod problem;
mod request;
mod resources;
mod search;
mod stage_times;

pub use codes::{Sampler, Selection, Source, Stage};
pub use denoiser::FeatureFrame;
pub use error::{Infeasible, PlannerError};
pub use goals::goal_configurations::goal_configurations;
pub use models::diffusion::{DiffusionModel, DiffusionSettings, PrecisionUnavailable};
pub use models::features::{
    BALL_FEATURES, COEFFICIENTS, END_FEATURES, features, residual_coefficients,
};
pub use models::sampled_collision;
pub use models::sampled_collision::SampledVerdict;
pub use motion::path_to_trajectory::MOST_CORRECTIONS;
pub use moving_obstacles::{MovingBalls, MovingObstacles};
pub use optimize::collision_correction::limit_pushes;
pub use path::metrics::{PathMetrics, SetMetrics, modes, set_metrics};
pub use path::sine_basis::SineBasis;
pub use path::smooth_least_squares::SmoothLeastSquares;
pub use path::waypoints::{
    WAYPOINTS, Waypoints, parameter, project_to_limits, resample, straight_path,
};
pub use pipeline::selection::select;
pub use plan::{Candidate, Certified, Draw, Failure, Passage, Plan};
pub use planner::Planner;
pub use problem::{Goal, Problem, Via};
pub use request::{
    CanBegin, EarlySelection, EndToMove, Guidance, PreviousPlan, Request, StartMotion, Supervision,
    ToBeDone, Told,
};
pub use resources::Models;
pub use search::edges::RrtSettings;
pub use search::random_configuration::random_configuration;
pub use search::rrt_connect::rrt_connect;
pub use stage_times::StageTimes;
