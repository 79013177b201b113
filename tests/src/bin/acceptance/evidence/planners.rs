//! The planners of a comparison.

use crate::fast_cases;

/// The paper's planner in its three forms, and the paper's rivals.
const OF_THE_PAPER: [&str; 8] = [
    "diffusion",
    "diffusion-post",
    "diffusion-guided",
    "c-rrt",
    "c-rrt-star",
    "w-rrt",
    "w-rrt-star",
    "apf",
];

/// Every planner that a comparison has.
pub(super) fn planners() -> impl Iterator<Item = &'static str> {
    fast_cases::PLANNERS.into_iter().chain(OF_THE_PAPER)
}
