//! Search of a path on certified edges: RRT-Connect, several searches at once, and trees that begin with known paths.

pub(crate) mod edges;
pub(crate) mod first_success;
mod nearest_neighbours;
pub(crate) mod portfolio;
pub(crate) mod random_configuration;
pub(crate) mod rrt_connect;
pub(crate) mod seeded_tree;
mod shortcut;
mod tree;
