//! How much of a path is signal and how much noise at each diffusion step.

use std::f64::consts::FRAC_PI_2;

/// Diffusion steps of training, T.
pub(crate) const STEPS: usize = 1000;
/// Offset of the cosine schedule.
const OFFSET: f64 = 0.008;

/// First step of a sampler that goes by λ: beyond it next to no signal is left, and λ runs away.
const NOISIEST: usize = 992;

/// The cosine schedule (Nichol and Dhariwal, "Improved Denoising Diffusion Probabilistic Models", ICML 2021), betas within
/// [1e-8, 0.999].
#[derive(Clone, Debug)]
pub(crate) struct Schedule {
    share: Vec<f64>,
}

impl Schedule {
    /// The schedule of 1000 steps.
    pub(crate) fn new() -> Self {
        let cosine = |step: usize| {
            let t = step as f64 / STEPS as f64;
            ((t + OFFSET) / (1.0 + OFFSET) * FRAC_PI_2).cos().powi(2)
        };
        let kept = |step| 1.0 - (1.0 - cosine(step + 1) / cosine(step)).clamp(1e-8, 0.999);
        let share = (0..STEPS).scan(1.0, |share, step| {
            *share *= kept(step);
            Some(*share)
        });
        Self {
            share: share.collect(),
        }
    }

    /// Signal and noise amplitudes √ᾱ and √(1 − ᾱ) at a step 0..999.
    pub(crate) fn amplitudes(&self, step: usize) -> Amplitudes {
        let share = self.share[step];
        Amplitudes {
            signal: share.sqrt(),
            noise: (1.0 - share).sqrt(),
        }
    }

    /// Falling steps, equally far from each other: round(linspace(0, 999, count)); one is 999.
    pub(crate) fn evenly(count: usize) -> Vec<usize> {
        let last = (STEPS - 1) as f64;
        let step = |i: usize| match count {
            1 => STEPS - 1,
            // ties to the even number, as NumPy and PyTorch round
            _ => (last * i as f64 / (count - 1) as f64).round_ties_even() as usize,
        };
        (0..count).rev().map(step).collect()
    }

    /// Falling steps at equally distant λ from that of step 992 to that of step 0; fewer than `count` where two coincide.
    pub(crate) fn by_log_ratio(&self, count: usize) -> Vec<usize> {
        let ratio = |step| self.amplitudes(step).log_ratio();
        let (first, last) = (ratio(NOISIEST), ratio(0));
        let nearest = |i: usize| {
            let wanted = first + (last - first) * i as f64 / (count.max(2) - 1) as f64;
            let distance = |step: &usize| (ratio(*step) - wanted).abs();
            (0..STEPS).min_by(|a, b| distance(a).total_cmp(&distance(b)))
        };
        let mut steps: Vec<usize> = (0..count).filter_map(nearest).collect();
        steps.dedup();
        steps
    }
}

/// What a noisy path consists of: signal · path + noise · ε.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Amplitudes {
    /// √ᾱ.
    pub signal: f64,
    /// √(1 − ᾱ).
    pub noise: f64,
}

impl Amplitudes {
    /// The clean path at the end of a sample.
    pub(crate) const CLEAN: Self = Self {
        signal: 1.0,
        noise: 0.0,
    };

    /// Half the logarithm of the ratio of signal to noise, λ.
    pub(crate) fn log_ratio(&self) -> f64 {
        (self.signal / self.noise).ln()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_share_of_signal_falls_from_almost_one_to_almost_nothing() {
        let schedule = Schedule::new();
        assert!(
            (schedule.share[0] - 0.999_958_9).abs() < 1e-6,
            "{}",
            schedule.share[0]
        );
        assert!(
            (schedule.share[499] - 0.493_84).abs() < 1e-4,
            "{}",
            schedule.share[499]
        );
        assert!(schedule.share[999] < 1e-8 && schedule.share[999] > 0.0);
        assert!(schedule.share.windows(2).all(|w| w[1] < w[0]));
    }

    #[test]
    fn fifty_visited_steps_are_those_of_the_reference() {
        let steps = Schedule::evenly(50);
        assert_eq!(steps[..4], [999, 979, 958, 938]);
        assert_eq!(steps[46..], [61, 41, 20, 0]);
        assert_eq!(Schedule::evenly(1), [999]);
    }

    #[test]
    fn steps_by_log_ratio_fall_and_are_as_far_apart_as_whole_steps_allow() {
        let schedule = Schedule::new();
        let steps = schedule.by_log_ratio(15);
        assert_eq!((steps[0], steps[14]), (NOISIEST, 0));
        let ratios = steps.iter().map(|s| schedule.amplitudes(*s).log_ratio());
        let ratios: Vec<f64> = ratios.collect();
        assert!(
            ratios[..14]
                .windows(2)
                .all(|w| (w[1] - w[0] - 0.683).abs() < 0.3),
            "{ratios:?}"
        );
        assert_eq!(schedule.by_log_ratio(1), [NOISIEST]);
    }
}
