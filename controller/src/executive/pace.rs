//! How fast the loop runs along a trajectory: braking, stopping and speed scaling without leaving the path.
//!
//! The trajectory is followed at path time t with rate r = dt/dτ, so a tendon's velocity is q̇ r and its acceleration
//! q̈ r² + q̇ ṙ. Where the trajectory keeps its limits at r = 1, every r ≤ 1 keeps the velocity limit and ṙ = 0 keeps the
//! acceleration limit; so the rate may always be kept, and changing it as fast as |q̈ r² + q̇ ṙ| ≤ a allows at each
//! instant is time-optimal (each greedy choice leaves the others at least as free). Both ends of a step are checked.

use pcc_model::{Configuration, TendonLimits, TendonMap};
use trajectory::{Knot, State, evaluate};

use crate::{TENDONS, TendonVector};

/// Rounds in which the end of a step is made to agree with its own limit.
const END_ROUNDS: usize = 3;

/// A tendon velocity under this share of what the limit changes in a microsecond does not bound ṙ.
const STANDSTILL_S: f64 = 1e-6;

/// Relative excess over a limit that rounding and the knots' own tolerance may cause.
const ROUNDING: f64 = 1e-5;

/// Maps configurations and their rates to tendons, and knows the tendons' limits.
#[derive(Clone, Debug)]
pub struct PaceLimits {
    rows: [Configuration; TENDONS],
    velocity_m_s: f64,
    acceleration_m_s2: f64,
}

impl PaceLimits {
    /// The limits of the tendons of `map`, both in m.
    #[must_use]
    pub fn new(map: &TendonMap, limits: &TendonLimits) -> Self {
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
        }
    }

    /// Tendon values of a configuration (or of its rate), per rad.
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

    /// The least and greatest ṙ at which no tendon's acceleration exceeds the limit; they enclose 0.
    fn rate_change_range(&self, state: &State, rate: f64) -> (f64, f64) {
        let limit = self.acceleration_m_s2;
        let (mut least, mut greatest) = (f64::NEG_INFINITY, f64::INFINITY);
        for row in &self.rows {
            let speed = row.dot(&state.velocity);
            if speed.abs() <= limit * STANDSTILL_S {
                continue;
            }
            let own = row.dot(&state.acceleration) * rate * rate;
            let (a, b) = ((-limit - own) / speed, (limit - own) / speed);
            least = least.max(a.min(b));
            greatest = greatest.min(a.max(b));
        }
        (least.min(0.0), greatest.max(0.0))
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

/// What the robot is commanded, in configuration space.
#[derive(Clone, Copy, Debug)]
pub struct Commanded {
    /// Configuration, rad.
    pub position: Configuration,
    /// Its rate, rad/s.
    pub velocity: Configuration,
    /// Its second derivative, rad/s².
    pub acceleration: Configuration,
}

impl Commanded {
    /// At rest.
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

    /// Goes on for `elapsed_s`, the rate changing towards `target_rate` as fast as the limits allow.
    pub fn advance(
        &mut self,
        knots: &[Knot],
        limits: &PaceLimits,
        target_rate: f64,
        elapsed_s: f64,
    ) -> Commanded {
        if elapsed_s <= 0.0 {
            let state = evaluate(knots, &mut self.hint, self.time_s);
            return self.commanded(&state, 0.0);
        }
        let wanted = (target_rate - self.rate) / elapsed_s;
        if wanted == 0.0 {
            self.time_s += self.rate * elapsed_s;
            let state = evaluate(knots, &mut self.hint, self.time_s);
            return self.commanded(&state, 0.0);
        }
        let here = evaluate(knots, &mut self.hint, self.time_s);
        let (least, greatest) = limits.rate_change_range(&here, self.rate);
        let mut change = wanted.clamp(least, greatest);
        let mut end = self.after(change, elapsed_s);
        for _ in 0..END_ROUNDS {
            let state = evaluate(knots, &mut end.hint, end.time_s);
            let (least, greatest) = limits.rate_change_range(&state, end.rate);
            if (least..=greatest).contains(&change) {
                break;
            }
            change = change.clamp(least, greatest);
            end = self.after(change, elapsed_s);
        }
        if (end.rate - target_rate).abs() < 1e-12 {
            end.rate = target_rate;
        }
        *self = end;
        let state = evaluate(knots, &mut self.hint, self.time_s);
        let (least, greatest) = limits.rate_change_range(&state, self.rate);
        self.commanded(&state, change.clamp(least, greatest))
    }

    fn after(&self, change: f64, elapsed_s: f64) -> Self {
        let rate = (self.rate + change * elapsed_s).clamp(0.0, 1.0);
        Self {
            time_s: self.time_s + 0.5 * (self.rate + rate) * elapsed_s,
            rate,
            hint: self.hint,
        }
    }

    fn commanded(&self, state: &State, change: f64) -> Commanded {
        Commanded {
            position: state.position,
            velocity: state.velocity * self.rate,
            acceleration: state.acceleration * (self.rate * self.rate) + state.velocity * change,
        }
    }
}
