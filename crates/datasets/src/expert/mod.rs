//! The expert: paths made by optimisation from targets drawn at random, each certified.

pub(crate) mod generate;
pub(crate) mod path_optimizer;
