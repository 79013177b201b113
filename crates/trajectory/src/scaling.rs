//! Motions slowed down or stopped along their own path, and stops from any state.

pub(crate) mod longest_stop;
pub(crate) mod rate_law;
pub(crate) mod stopping;
mod three_part_stop;
