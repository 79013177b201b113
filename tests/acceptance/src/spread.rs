//! Order statistics.

use std::fmt::{self, Display, Formatter};

/// Median, 90th and 99th percentile, and the largest.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spread {
    pub(crate) median: f64,
    pub(crate) p90: f64,
    pub(crate) p99: f64,
    pub(crate) max: f64,
}

impl Spread {
    /// NaN of no values.
    pub(crate) fn of(values: &[f64]) -> Self {
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let at = |share: f64| match sorted.len() {
            0 => f64::NAN,
            count => sorted[((count - 1) as f64 * share).round() as usize],
        };
        Self {
            median: at(0.5),
            p90: at(0.9),
            p99: at(0.99),
            max: at(1.0),
        }
    }
}

impl Display for Spread {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        let Self {
            median,
            p90,
            p99,
            max,
        } = self;
        write!(
            formatter,
            "median {median:.3}, p90 {p90:.3}, p99 {p99:.3}, max {max:.3}"
        )
    }
}

/// The middle one, or the upper of the two.
pub(crate) fn median(values: &[f64]) -> f64 {
    Spread::of(values).median
}

/// The smallest value that half of all do not exceed, as histograms have it; NaN of no values.
pub(crate) fn lower_median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let middle = sorted.len().saturating_sub(1) / 2;
    sorted.get(middle).copied().unwrap_or(f64::NAN)
}

#[cfg(test)]
mod unit {
    use super::*;

    #[test]
    fn percentiles_are_values_that_were_there() {
        let values: Vec<f64> = (0..=1000).rev().map(f64::from).collect();
        let Spread {
            median,
            p90,
            p99,
            max,
        } = Spread::of(&values);
        assert_eq!([median, p90, p99, max], [500.0, 900.0, 990.0, 1000.0]);
        assert!(Spread::of(&[]).median.is_nan());
        assert_eq!(super::median(&[2.0, 1.0]), 2.0);
        assert_eq!(lower_median(&[2.0, 1.0]), 1.0);
        assert!(lower_median(&[]).is_nan());
    }
}
