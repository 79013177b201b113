//! The planners of a comparison.

use crate::fast_cases;

/// The paper's planner in its three forms, the paper's rivals, and the anytime ones.
const OTHERS: [&str; 10] = [
    "diffusion",
    "diffusion-post",
    "diffusion-guided",
    "c-rrt",
    "c-rrt-star",
    "w-rrt",
    "w-rrt-star",
    "apf",
    "rrt-star",
    "bit-star",
];

/// Planners that end by the clock: another run makes other motions.
pub(super) const BY_THE_CLOCK: [&str; 2] = ["rrt-star", "bit-star"];

/// Every planner that a comparison has.
pub(super) fn planners() -> impl Iterator<Item = &'static str> {
    fast_cases::PLANNERS.into_iter().chain(OTHERS)
}
