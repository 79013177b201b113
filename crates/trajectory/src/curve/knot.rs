//! The points of a motion that are stored, and the state anywhere on it.

use pcc_model::Configuration;

/// A stored point of a motion: time in seconds, position in rad, velocity in rad/s, acceleration in rad/s².
///
/// Its bytes are those of the numbers in this order: as it lies in memory, it travels.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Knot {
    /// Seconds since the start of the motion.
    pub time: f64,
    /// Configuration ζ, rad.
    pub position: Configuration,
    /// dζ/dt, rad/s.
    pub velocity: Configuration,
    /// d²ζ/dt², rad/s².
    pub acceleration: Configuration,
}

impl Knot {
    /// A knot without motion at `time`.
    pub fn resting(time: f64, position: Configuration) -> Self {
        Self {
            time,
            position,
            velocity: Configuration::zeros(),
            acceleration: Configuration::zeros(),
        }
    }

    /// The knot of a state at `time`.
    pub fn of(time: f64, state: &State) -> Self {
        Self {
            time,
            position: state.position,
            velocity: state.velocity,
            acceleration: state.acceleration,
        }
    }

    /// Whether every number of the knot is finite.
    pub fn is_finite(&self) -> bool {
        let finite = |v: &Configuration| v.iter().all(|x| x.is_finite());
        self.time.is_finite()
            && finite(&self.position)
            && finite(&self.velocity)
            && finite(&self.acceleration)
    }
}

/// Where a motion is at one instant, with its first three time derivatives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State {
    /// Configuration ζ, rad.
    pub position: Configuration,
    /// dζ/dt, rad/s.
    pub velocity: Configuration,
    /// d²ζ/dt², rad/s².
    pub acceleration: Configuration,
    /// d³ζ/dt³, rad/s³.
    pub jerk: Configuration,
}

impl State {
    /// The state of a robot that rests at `position`.
    pub fn resting(position: Configuration) -> Self {
        let zero = Configuration::zeros();
        Self {
            position,
            velocity: zero,
            acceleration: zero,
            jerk: zero,
        }
    }
}
