//! How many sections, tendons and configuration components a robot has, and the vectors of these lengths.

/// Number of sections.
pub const SECTIONS: usize = 3;
/// Tendons that a robot may have: as many as the messages between the processes carry.
pub const MAX_TENDONS: usize = 9;
/// Number of configuration components: two a section.
pub const DOF: usize = 2 * SECTIONS;

/// A configuration `[ξ11, ξ12, ξ21, ξ22, ξ31, ξ32]`, radians.
pub type Configuration = nalgebra::SVector<f64, DOF>;
/// A position or a direction in the base frame.
pub type Point = nalgebra::Vector3<f64>;
