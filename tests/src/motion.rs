//! What a sequence of tendon set-points must keep, measured from the sequence alone.

use pcc_model::TendonLimits;
use shared_types::message::{Cycle, RobotState};

/// The tendons at one instant: m, m/s, and m/s² where that is known.
#[derive(Clone, Copy, Debug)]
pub struct TendonSample {
    /// When, ns.
    pub stamp_ns: i64,
    /// Length changes, m.
    pub position: [f64; 9],
    /// Their velocities, m/s.
    pub velocity: [f64; 9],
    /// Their accelerations, m/s²; zero where not published.
    pub acceleration: [f64; 9],
}

impl From<&Cycle> for TendonSample {
    fn from(cycle: &Cycle) -> Self {
        Self {
            stamp_ns: cycle.stamp_mono_ns,
            position: cycle.setpoint_m,
            velocity: cycle.setpoint_velocity_m_s,
            acceleration: cycle.setpoint_acceleration_m_s2,
        }
    }
}

impl From<&RobotState> for TendonSample {
    fn from(state: &RobotState) -> Self {
        Self {
            stamp_ns: state.stamp_mono_ns,
            position: state.accepted_setpoint_m,
            velocity: state.accepted_velocity_m_s,
            acceleration: [0.0; 9],
        }
    }
}

/// Largest use of each limit (1: at the limit) and the largest steps.
#[derive(Clone, Copy, Debug, Default)]
pub struct LimitsKept {
    /// Published velocities over the limit.
    pub velocity: f64,
    /// Published accelerations over the limit.
    pub acceleration: f64,
    /// Position differences over time, over the velocity limit.
    pub difference_velocity: f64,
    /// Velocity differences over time, over the acceleration limit.
    pub difference_acceleration: f64,
    /// |Δp − (v₀ + v₁)Δt/2| over a Δt²: what the velocities at both ends do not explain of a step. Motions within the
    /// acceleration limit a have at most 1/4. (Δt: at most the 20 ms by which a cycle may go on.)
    pub unexplained_step: f64,
    /// Largest step of one tendon between two samples, m.
    pub largest_step_m: f64,
    /// Samples looked at.
    pub samples: usize,
}

/// Measures a sequence; `slack_s` is added to each time difference, for stamps that are not evaluation times.
#[must_use]
pub fn limits_kept(samples: &[TendonSample], limits: &TendonLimits, slack_s: f64) -> LimitsKept {
    let mut kept = LimitsKept {
        samples: samples.len(),
        ..LimitsKept::default()
    };
    for sample in samples {
        kept.velocity = kept
            .velocity
            .max(largest(&sample.velocity) / limits.velocity);
        kept.acceleration = kept
            .acceleration
            .max(largest(&sample.acceleration) / limits.acceleration);
    }
    let pairs = samples.windows(2).map(|pair| (pair[0], pair[1]));
    kept.add_pairs(pairs, limits, slack_s);
    kept
}

impl LimitsKept {
    /// Keeps what single samples showed.
    pub fn forget_steps(&mut self) {
        *self = Self {
            velocity: self.velocity,
            acceleration: self.acceleration,
            samples: self.samples,
            ..Self::default()
        };
    }

    /// Measures the steps between the samples of each pair.
    pub fn add_pairs(
        &mut self,
        pairs: impl Iterator<Item = (TendonSample, TendonSample)>,
        limits: &TendonLimits,
        slack_s: f64,
    ) {
        pairs.for_each(|(before, after)| self.add_pair(&before, &after, limits, slack_s));
    }

    fn add_pair(
        &mut self,
        before: &TendonSample,
        after: &TendonSample,
        limits: &TendonLimits,
        slack_s: f64,
    ) {
        let stamped_s = (after.stamp_ns - before.stamp_ns) as f64 * 1e-9;
        let elapsed_s = stamped_s + slack_s;
        // A later cycle goes on by no more than the cap: the path time lags then, and the robot falls short.
        let moved_s = stamped_s.min(STEP_CAP_S);
        for tendon in 0..9 {
            let step = after.position[tendon] - before.position[tendon];
            let (begin, end) = (before.velocity[tendon], after.velocity[tendon]);
            let mean = 0.5 * (begin + end);
            let allowed = mean.abs() * slack_s + ROUNDING_M;
            let unexplained = (step - mean * moved_s).abs() - allowed;
            let raise = |figure: &mut f64, value: f64| *figure = figure.max(value);
            raise(&mut self.largest_step_m, step.abs());
            raise(
                &mut self.difference_velocity,
                (step.abs() - ROUNDING_M) / elapsed_s / limits.velocity,
            );
            raise(
                &mut self.difference_acceleration,
                (end - begin).abs() / elapsed_s / limits.acceleration,
            );
            raise(
                &mut self.unexplained_step,
                unexplained / (limits.acceleration * (moved_s + slack_s).powi(2)),
            );
        }
    }
}

/// The shipped controller's `step_cap_ms`, s.
const STEP_CAP_S: f64 = 0.02;

/// Positions and times are rounded: stamps to a nanosecond.
const ROUNDING_M: f64 = 1e-10;

fn largest(values: &[f64; 9]) -> f64 {
    values.iter().fold(0.0, |most, value| most.max(value.abs()))
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: TendonLimits = TendonLimits {
        velocity: 1.0,
        acceleration: 10.0,
        jerk: 100.0,
    };

    /// A sine within the limits, sampled each millisecond.
    fn sine() -> Vec<TendonSample> {
        let sample = |i: i64| {
            let t = i as f64 * 1e-3;
            TendonSample {
                stamp_ns: i * 1_000_000,
                position: [0.09 * (10.0 * t).sin(); 9],
                velocity: [0.9 * (10.0 * t).cos(); 9],
                acceleration: [-9.0 * (10.0 * t).sin(); 9],
            }
        };
        (0..2000).map(sample).collect()
    }

    #[test]
    fn a_motion_within_its_limits_keeps_them() {
        let kept = limits_kept(&sine(), &LIMITS, 0.0);
        assert!((0.89..0.91).contains(&kept.velocity), "{kept:?}");
        assert!((0.89..0.91).contains(&kept.difference_velocity), "{kept:?}");
        assert!((0.89..0.91).contains(&kept.acceleration), "{kept:?}");
        assert!(
            (0.89..0.91).contains(&kept.difference_acceleration),
            "{kept:?}"
        );
        assert!(kept.unexplained_step < 0.01, "{kept:?}");
    }

    #[test]
    fn a_jump_of_position_or_of_velocity_is_seen() {
        let mut jump = sine();
        jump[1000..]
            .iter_mut()
            .for_each(|sample| sample.position[4] += 1e-4);
        let kept = limits_kept(&jump, &LIMITS, 0.0);
        assert!(kept.unexplained_step > 5.0, "{kept:?}");
        let mut kink = sine();
        kink[1000..]
            .iter_mut()
            .for_each(|sample| sample.velocity[4] += 0.05);
        let kept = limits_kept(&kink, &LIMITS, 0.0);
        assert!(kept.difference_acceleration > 1.5, "{kept:?}");
    }
}
