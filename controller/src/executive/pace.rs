//! How fast the loop runs along a trajectory: braking, stopping and speed scaling without leaving the path.
//!
//! The trajectory is followed at path time t with rate r = dt/dτ, so a tendon's velocity is q̇ r and its acceleration
//! q̈ r² + q̇ ṙ. The rate law ([`trajectory::RateLaw`]) chooses r. It judges the trajectory at both ends of its steps
//! and at the knots between them, so a longer cycle is made of several equal steps.

use pcc_model::{Configuration, Robot};
use trajectory::{BRAKING_SHARE, Knot, Playback, RateLaw, State, evaluate};

use crate::{TENDONS, TendonVector};

/// Bounds of the rate law's longest step, s: short enough for [`BRAKING_SHARE`], long enough for a cycle's work.
const LONGEST_STEP_S: [f64; 2] = [0.25e-3, 1.5e-3];

/// Relative excess over a limit that rounding and the knots' own tolerance may cause.
const ROUNDING: f64 = 1e-5;

/// Maps configurations and their rates to tendons, and knows the tendons' limits.
#[derive(Clone, Debug)]
pub struct PaceLimits {
    rows: [Configuration; TENDONS],
    velocity_m_s: f64,
    acceleration_m_s2: f64,
    law: RateLaw,
    longest_step_s: f64,
}

impl PaceLimits {
    /// The limits of `robot` (lengths in m).
    #[must_use]
    pub fn new(robot: &Robot) -> Self {
        let (map, limits) = (&robot.tendons, &robot.tendon_limits);
        let spare = (1.0 - BRAKING_SHARE) * limits.acceleration;
        let [shortest_s, longest_s] = LONGEST_STEP_S;
        let matrix = map.matrix();
        let rows = std::array::from_fn(|tendon| {
            if tendon < map.count() {
                Configuration::from_fn(|column, _| matrix[(tendon, column)])
            } else {
                Configuration::zeros()
            }
        });
        Self {
            rows,
            velocity_m_s: limits.velocity,
            acceleration_m_s2: limits.acceleration,
            law: RateLaw::new(map, limits.acceleration * BRAKING_SHARE),
            longest_step_s: (8.0 * spare / limits.jerk).clamp(shortest_s, longest_s),
        }
    }

    /// Tendon values of a configuration, m, or of its derivatives.
    #[must_use]
    pub fn tendons(&self, configuration: &Configuration) -> TendonVector {
        std::array::from_fn(|tendon| self.rows[tendon].dot(configuration))
    }

    /// Whether velocities and accelerations are finite and within the limits, up to rounding.
    #[must_use]
    pub fn allow(&self, velocity_m_s: &TendonVector, acceleration_m_s2: &TendonVector) -> bool {
        let within = |values: &TendonVector, limit: f64| {
            values
                .iter()
                .all(|value| value.abs() <= limit * (1.0 + ROUNDING))
        };
        within(velocity_m_s, self.velocity_m_s) && within(acceleration_m_s2, self.acceleration_m_s2)
    }
}

/// Where on a trajectory the loop is, and how fast it goes.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    /// Path time, s.
    pub time_s: f64,
    /// Path time per time, 0..=1.
    pub rate: f64,
    hint: usize,
}

/// The commanded configuration and its derivatives.
#[derive(Clone, Copy, Debug)]
pub struct Commanded {
    /// Configuration, rad.
    pub position: Configuration,
    /// Velocity, rad/s.
    pub velocity: Configuration,
    /// Acceleration, rad/s².
    pub acceleration: Configuration,
}

impl Commanded {
    /// A command to rest at `position`, rad.
    #[must_use]
    pub fn resting(position: Configuration) -> Self {
        Self {
            position,
            velocity: Configuration::zeros(),
            acceleration: Configuration::zeros(),
        }
    }
}

impl Pace {
    /// At the beginning of a trajectory (which begins at rest, so any rate is continuous there).
    #[must_use]
    pub fn beginning(rate: f64) -> Self {
        Self {
            time_s: 0.0,
            rate,
            hint: 0,
        }
    }

    /// Goes on at another path time, of another trajectory, at the same rate.
    pub fn change_over(&mut self, time_s: f64) {
        (self.time_s, self.hint) = (time_s, 0);
    }

    /// Moves on by `elapsed_s`, the rate changing towards `target` as fast as the limits allow.
    pub fn advance(
        &mut self,
        knots: &[Knot],
        limits: &PaceLimits,
        target: f64,
        elapsed_s: f64,
    ) -> Commanded {
        let steps = (elapsed_s / limits.longest_step_s).ceil().max(0.0);
        let (mut left, step_s) = (steps, elapsed_s / steps);
        let mut rate_change_per_s = 0.0;
        while left > 0.0 {
            left -= 1.0;
            let playback = Playback {
                knots,
                time: self.time_s,
                rate: self.rate,
            };
            let step = limits.law.step(&playback, &mut self.hint, target, step_s);
            rate_change_per_s = (step.rate - self.rate) / step_s;
            self.rate = step.rate;
            self.time_s += step.advance;
        }
        let state = evaluate(knots, &mut self.hint, self.time_s);
        self.commanded(&state, rate_change_per_s)
    }

    fn commanded(&self, state: &State, rate_change_per_s: f64) -> Commanded {
        Commanded {
            position: state.position,
            velocity: state.velocity * self.rate,
            acceleration: state.acceleration * (self.rate * self.rate)
                + state.velocity * rate_change_per_s,
        }
    }
}
