//! What a sequence of tendon set-points must keep, measured from the sequence alone.

use std::sync::LazyLock;

use pcc_model::TendonLimits;

use crate::world::shipped_number;

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
    /// acceleration limit a have at most 1/4. (Δt: at most the `step_cap_ms` by which a cycle may go on.)
    pub unexplained_step: f64,
    /// Largest step of one tendon between two samples, m.
    pub largest_step_m: f64,
    /// Samples looked at.
    pub samples: usize,
}

/// Measures a sequence by its own stamps.
#[must_use]
pub fn limits_kept(samples: &[TendonSample], limits: &TendonLimits) -> LimitsKept {
    let mut kept = LimitsKept::default();
    for sample in samples {
        kept.add(sample, limits);
    }
    for pair in samples.windows(2) {
        kept.add_neighbours(&pair[0], &pair[1], limits);
    }
    kept
}

impl LimitsKept {
    /// Looks at one sample by itself.
    pub fn add(&mut self, sample: &TendonSample, limits: &TendonLimits) {
        self.samples += 1;
        raise(
            &mut self.velocity,
            largest(&sample.velocity) / limits.velocity,
        );
        let acceleration = largest(&sample.acceleration) / limits.acceleration;
        raise(&mut self.acceleration, acceleration);
    }

    /// Looks at the step from one sample to a later one, however much later.
    pub fn add_step(&mut self, before: &TendonSample, after: &TendonSample, limits: &TendonLimits) {
        let elapsed_s = (after.stamp_ns - before.stamp_ns) as f64 * 1e-9;
        for tendon in 0..9 {
            let step = (after.position[tendon] - before.position[tendon]).abs();
            let change = (after.velocity[tendon] - before.velocity[tendon]).abs();
            raise(&mut self.largest_step_m, step);
            let velocity = (step - ROUNDING_M) / elapsed_s / limits.velocity;
            raise(&mut self.difference_velocity, velocity);
            let acceleration = change / elapsed_s / limits.acceleration;
            raise(&mut self.difference_acceleration, acceleration);
        }
    }

    /// Looks at the step between two successive cycles: the velocities at its ends have to explain it, too.
    pub fn add_neighbours(
        &mut self,
        before: &TendonSample,
        after: &TendonSample,
        limits: &TendonLimits,
    ) {
        self.add_step(before, after, limits);
        // A later cycle goes on by no more than the cap: the path time lags then, and the robot falls short.
        let moved_s = ((after.stamp_ns - before.stamp_ns) as f64 * 1e-9).min(*STEP_CAP_S);
        for tendon in 0..9 {
            let step = after.position[tendon] - before.position[tendon];
            let mean = 0.5 * (before.velocity[tendon] + after.velocity[tendon]);
            let unexplained = (step - mean * moved_s).abs() - ROUNDING_M;
            let allowed = limits.acceleration * moved_s.powi(2);
            raise(&mut self.unexplained_step, unexplained / allowed);
        }
    }
}

/// Raises a figure to a value; NaN is larger than everything, and stays.
pub fn raise(figure: &mut f64, value: f64) {
    if value.is_nan() || value > *figure {
        *figure = value;
    }
}

/// The shipped controller's `step_cap_ms`, s.
static STEP_CAP_S: LazyLock<f64> =
    LazyLock::new(|| 1e-3 * shipped_number("controller.toml", "step_cap_ms"));

/// Positions and times are rounded: stamps to a nanosecond.
const ROUNDING_M: f64 = 1e-10;

/// The largest absolute value; NaN if there is one.
#[must_use]
pub fn largest(values: &[f64; 9]) -> f64 {
    let mut most = 0.0;
    for value in values {
        raise(&mut most, value.abs());
    }
    most
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
        let kept = limits_kept(&sine(), &LIMITS);
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
        let kept = limits_kept(&jump, &LIMITS);
        assert!(kept.unexplained_step > 5.0, "{kept:?}");
        let mut kink = sine();
        kink[1000..]
            .iter_mut()
            .for_each(|sample| sample.velocity[4] += 0.05);
        let kept = limits_kept(&kink, &LIMITS);
        assert!(kept.difference_acceleration > 1.5, "{kept:?}");
    }
}
