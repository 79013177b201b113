//! The tracking error: how far the robot is from the commanded configuration, filtered against measurement noise.
//!
//! Rule: each measurement is compared with the last cycle's command extrapolated, at its velocity, to the instant of the
//! measurement. The six-component error goes through a first-order low pass (time constant: setting
//! `tracking_filter_ms`), and its Euclidean norm is compared with the trajectory's path tolerance. So zero-mean noise far above
//! the tolerance for one sample does not trip it, and a lasting error of twice the tolerance trips after 0.7 time
//! constants.

use pcc_model::Configuration;

/// The filtered tracking error.
#[derive(Clone, Copy, Debug)]
pub struct Tracking {
    filter_s: f64,
    error: Configuration,
    measured_ns: Option<i64>,
}

impl Tracking {
    /// A tracking error of zero; `filter_s` is the low pass's time constant, 0 for none.
    #[must_use]
    pub fn new(filter_s: f64) -> Self {
        Self {
            filter_s,
            error: Configuration::zeros(),
            measured_ns: None,
        }
    }

    /// Sets the error to zero, as before the first measurement.
    pub fn restart(&mut self) {
        *self = Self::new(self.filter_s);
    }

    /// Takes in the error of a measurement made at `stamp_ns`; returns the filtered norm, rad.
    pub fn observe(&mut self, stamp_ns: i64, error: &Configuration) -> f64 {
        #[expect(
            clippy::cast_precision_loss,
            reason = "intervals are far below 2^53 ns"
        )]
        let elapsed_s = self
            .measured_ns
            .map_or(0.0, |before| (stamp_ns - before).max(0) as f64 * 1e-9);
        self.measured_ns = Some(stamp_ns);
        let weight = if self.filter_s > 0.0 {
            elapsed_s / (self.filter_s + elapsed_s)
        } else {
            1.0
        };
        self.error += (error - self.error) * weight;
        self.norm_rad()
    }

    /// The filtered norm, rad.
    #[must_use]
    pub fn norm_rad(&self) -> f64 {
        self.error.norm()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    fn error(size: f64) -> Configuration {
        Configuration::repeat(size / 6.0_f64.sqrt())
    }

    #[test]
    fn one_wild_sample_is_forgiven_and_a_lasting_error_is_not() {
        let mut tracking = Tracking::new(0.010);
        tracking.observe(0, &error(0.0));
        assert!(tracking.observe(MS, &error(0.1)) < 0.01);
        for ms in 2..100 {
            tracking.observe(ms * MS, &error(0.0));
        }
        assert!(tracking.norm_rad() < 1e-5);
        let first_over = (100..200).find(|ms| tracking.observe(ms * MS, &error(0.04)) > 0.02);
        // 0.7 time constants.
        assert!((105..=109).contains(&first_over.unwrap()), "{first_over:?}");
    }

    #[test]
    fn alternating_noise_averages_out() {
        let mut tracking = Tracking::new(0.010);
        for ms in 0..1_000 {
            let sign = if ms % 2 == 0 { 1.0 } else { -1.0 };
            tracking.observe(ms * MS, &error(0.05 * sign));
        }
        assert!(tracking.norm_rad() < 0.003, "{}", tracking.norm_rad());
    }
}
