//! Confidence intervals by the percentile bootstrap over targets (Efron 1979): neither the candidates of a case nor the cases of a target, which
//! have their scene and their target in common, are independent samples.

use crate::averages::percentile;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use rayon::prelude::*;
use serde::Serialize;
use std::collections::BTreeMap;

/// Sets of targets that are drawn with replacement.
const RESAMPLES: u64 = 1000;
/// Tails that are cut off on both sides.
const TAIL: f64 = 0.025;
/// Targets below which there are no bounds: a sign that so few agree in is chance too often (all of five do in 2 × 2⁻⁵ of cases without a
/// difference).
const FEWEST_TARGETS: usize = 6;

/// A figure with its 95 % interval; without a value where no case has one, and without bounds where the cases have fewer than six targets.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct Interval {
    pub(crate) value: Option<f64>,
    pub(crate) low: Option<f64>,
    pub(crate) high: Option<f64>,
}

impl Interval {
    /// The figure and its bounds multiplied by a factor.
    pub(crate) fn scaled(self, factor: f64) -> Self {
        let [value, low, high] = [self.value, self.low, self.high].map(|it| Some(factor * it?));
        Self { value, low, high }
    }
}

/// A figure of some cases, and its interval over sets of as many targets drawn from theirs, each with all of its cases; resamples without a
/// value are left out.
pub(crate) fn interval<T: Sync>(
    cases: &[T],
    target: impl Fn(&T) -> i32,
    figure: impl Fn(&[&T]) -> Option<f64> + Sync,
) -> Interval {
    let all: Vec<&T> = cases.iter().collect();
    let mut by_target: BTreeMap<i32, Vec<&T>> = BTreeMap::new();
    for case in cases {
        by_target.entry(target(case)).or_default().push(case);
    }
    let targets: Vec<Vec<&T>> = by_target.into_values().collect();
    let resample = |seed| {
        let mut rng = Pcg64::seed_from_u64(seed);
        let drawn = (0..targets.len()).map(|_| &targets[rng.random_range(0..targets.len())]);
        figure(&drawn.flatten().copied().collect::<Vec<_>>())
    };
    let resamples = match targets.len() < FEWEST_TARGETS {
        true => 0..0,
        false => 0..RESAMPLES,
    };
    let mut values: Vec<f64> = resamples.into_par_iter().filter_map(resample).collect();
    values.sort_by(f64::total_cmp);
    Interval {
        value: figure(&all),
        low: percentile(&values, TAIL),
        high: percentile(&values, 1.0 - TAIL),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::averages::mean;

    /// The interval of a mean is that of the normal distribution, however often each target's value is repeated.
    #[test]
    fn the_interval_of_a_mean_is_two_standard_errors_of_the_targets_wide_on_each_side() {
        let mut rng = Pcg64::seed_from_u64(1);
        let values: Vec<f64> = (0..400).map(|_| rng.random_range(-1.0..1.0)).collect();
        let standard_error = (1.0_f64 / 3.0).sqrt() / 20.0;
        for cases_of_a_target in [1, 5] {
            let cases = (0..).zip(&values);
            let cases: Vec<(i32, f64)> = cases
                .flat_map(|(target, value)| vec![(target, *value); cases_of_a_target])
                .collect();
            let mean = |cases: &[&(i32, f64)]| mean(cases.iter().map(|it| it.1));
            let found = interval(&cases, |it| it.0, mean);
            let width = found.high.unwrap() - found.low.unwrap();
            assert!(
                (width / (2.0 * 1.96 * standard_error) - 1.0).abs() < 0.1,
                "{cases_of_a_target}: {found:?}"
            );
        }
    }

    #[test]
    fn no_cases_have_no_value() {
        let found = interval(&[], |_| 0, |values: &[&f64]| values.first().map(|it| **it));
        assert!(found.value.is_none() && found.low.is_none() && found.high.is_none());
    }

    #[test]
    fn cases_of_one_target_have_no_bounds() {
        let mean = |values: &[&f64]| mean(values.iter().map(|it| **it));
        let found = interval(&[1.0, 2.0], |_| 7, mean);
        assert_eq!(found.value, Some(1.5));
        assert!(found.low.is_none() && found.high.is_none());
    }
}
