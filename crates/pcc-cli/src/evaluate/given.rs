//! What was drawn for a case before it is planned.

use pcc_model::Configuration;
use planning::Waypoints;

/// What is followed in place of a sampler's paths.
pub(crate) enum Given {
    /// Whole paths, which may collide.
    Paths(Vec<Waypoints>),
    /// Corners of certified edges.
    Polylines(Vec<Vec<Configuration>>),
}
