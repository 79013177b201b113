//! Motions slowed down or stopped along their own path.

pub(crate) mod longest_stop;
pub(crate) mod rate_law;
mod short_stop;
mod stop_profile;
pub(crate) mod stopping;
