//! How much of the tendons' limits a motion uses.

pub(crate) mod control;
pub(crate) mod extremes;
pub(crate) mod limit_use;
pub(crate) mod tendon_rows;
