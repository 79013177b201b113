//! Confidence intervals by the percentile bootstrap over cases (Efron 1979): the candidates of a case are no independent samples.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use rayon::prelude::*;
use serde::Serialize;

/// Sets of cases that are drawn with replacement.
const RESAMPLES: u64 = 1000;
/// Tails that are cut off on both sides.
const TAIL: f64 = 0.025;

/// A figure with its 95 % interval; without a value where no case has one.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct Interval {
    pub(crate) value: Option<f64>,
    pub(crate) low: Option<f64>,
    pub(crate) high: Option<f64>,
}

/// A figure of some cases, and its interval over sets of as many cases drawn from them; resamples without a value are left out.
pub(crate) fn interval<T: Sync>(
    cases: &[T],
    figure: impl Fn(&[&T]) -> Option<f64> + Sync,
) -> Interval {
    let all: Vec<&T> = cases.iter().collect();
    let resample = |seed| {
        let mut rng = Pcg64::seed_from_u64(seed);
        let drawn = (0..cases.len()).map(|_| &cases[rng.random_range(0..cases.len())]);
        figure(&drawn.collect::<Vec<_>>())
    };
    let resamples = 0..if cases.is_empty() { 0 } else { RESAMPLES };
    let mut values: Vec<f64> = resamples.into_par_iter().filter_map(resample).collect();
    values.sort_by(f64::total_cmp);
    let at = |share: f64| {
        let index = (values.len().saturating_sub(1) as f64 * share).round() as usize;
        values.get(index).copied()
    };
    Interval {
        value: figure(&all),
        low: at(TAIL),
        high: at(1.0 - TAIL),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mean(values: &[&f64]) -> Option<f64> {
        Some(values.iter().copied().sum::<f64>() / values.len() as f64)
    }

    /// The interval of a mean is that of the normal distribution.
    #[test]
    fn the_interval_of_a_mean_is_two_standard_errors_wide_on_each_side() {
        let mut rng = Pcg64::seed_from_u64(1);
        let values: Vec<f64> = (0..400).map(|_| rng.random_range(-1.0..1.0)).collect();
        let found = interval(&values, mean);
        let standard_error = (1.0_f64 / 3.0).sqrt() / 20.0;
        let width = found.high.unwrap() - found.low.unwrap();
        assert!(
            (width / (2.0 * 1.96 * standard_error) - 1.0).abs() < 0.1,
            "{found:?}"
        );
    }

    #[test]
    fn no_cases_have_no_value() {
        let found = interval(&[], |values: &[&f64]| values.first().copied().copied());
        assert!(found.value.is_none() && found.low.is_none() && found.high.is_none());
    }
}
