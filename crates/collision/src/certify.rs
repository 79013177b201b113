//! Certificates: that whole motions touch nothing, and how clear they are.

pub(crate) mod bisection;
pub(crate) mod body_state;
pub(crate) mod edge;
pub(crate) mod minimum;
pub(crate) mod motion_bound;
pub(crate) mod moving_ball_cover;
pub(crate) mod moving_balls;
pub(crate) mod obstacles;
pub(crate) mod remaining_pieces;
pub(crate) mod scene_at_rest;
pub(crate) mod standing;
pub(crate) mod trajectory;
pub(crate) mod verdict;
