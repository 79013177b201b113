//! Time parameterization: from waypoints to a motion within the tendons' limits.

pub(crate) mod in_motion;
pub(crate) mod interval;
pub(crate) mod jerk;
pub(crate) mod options;
pub(crate) mod overlap;
pub(crate) mod placement;
pub(crate) mod tendon_path;
pub(crate) mod time_parameterizer;
pub(crate) mod topp;
pub(crate) mod width;
