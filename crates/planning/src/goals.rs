//! Goal configurations of a tip position by inverse kinematics, and path ends that reach them.

pub(crate) mod attach;
pub(crate) mod goal_configurations;
pub(crate) mod inverse_kinematics;
pub(crate) mod newton;
