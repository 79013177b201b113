//! Averages of some values.

/// None where there are no values.
pub(crate) fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0), |(sum, count), value| (sum + value, count + 1));
    (count > 0).then(|| sum / f64::from(count))
}

/// The mean of the two middle values where their number is even.
pub(crate) fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    let half = values.len() / 2;
    if values.is_empty() {
        return None;
    }
    let is_even = values.len().is_multiple_of(2);
    let (lower, upper, _) = values.select_nth_unstable_by(half, f64::total_cmp);
    let below = lower.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    Some(if is_even {
        0.5 * (below + *upper)
    } else {
        *upper
    })
}

/// The one of sorted values nearest to a share of them (0 to 1): of 0.5 one in the middle.
pub(crate) fn percentile(sorted: &[f64], share: f64) -> Option<f64> {
    let place = (sorted.len().saturating_sub(1) as f64 * share).round() as usize;
    sorted.get(place).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_values_at_the_nearest_place() {
        let sorted = [1.0, 2.0, 3.0, 4.0, 5.0];
        let at = [0.0, 0.1, 0.3, 0.5, 0.95, 1.0].map(|share| percentile(&sorted, share).unwrap());
        assert_eq!(at, [1.0, 1.0, 2.0, 3.0, 5.0, 5.0]);
        assert_eq!(percentile(&[], 0.5), None);
    }

    #[test]
    fn medians_are_those_of_sorted_values() {
        assert_eq!(median([3.0, 1.0, 2.0].into_iter()), Some(2.0));
        assert_eq!(median([4.0, 1.0, 3.0, 2.0].into_iter()), Some(2.5));
        assert_eq!(median(std::iter::empty()), None);
    }
}
