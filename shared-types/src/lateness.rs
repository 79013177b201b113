//! The loop's lateness histogram: four bins an octave from one microsecond, so 64 bins reach 46 ms.
//!
//! Bin 0 holds wake-ups less than 1.024 µs late; bin `1 + 4 e + s` holds `[2^e (1 + s/4), 2^e (1 + (s+1)/4))` × 1.024 µs;
//! the last bin holds everything later.

use crate::capacity::HISTOGRAM_BINS;

/// Width of the first bin as a power of two of nanoseconds.
const FIRST_BIN_BITS: u32 = 10;

/// The bin of a lateness in nanoseconds; constant time, integer arithmetic only.
#[must_use]
pub fn bin_of(lateness_ns: u64) -> usize {
    if lateness_ns >> FIRST_BIN_BITS == 0 {
        return 0;
    }
    let octave = lateness_ns.ilog2() - FIRST_BIN_BITS;
    let quarter = (lateness_ns >> (octave + FIRST_BIN_BITS - 2)) & 3;
    (1 + 4 * octave as usize + quarter as usize).min(HISTOGRAM_BINS - 1)
}

/// The least lateness, nanoseconds, that falls into `bin`.
#[must_use]
pub fn lower_edge_ns(bin: usize) -> u64 {
    match bin.min(HISTOGRAM_BINS - 1) {
        0 => 0,
        bin => {
            let (octave, quarter) = ((bin - 1) / 4, (bin - 1) % 4);
            (4 + quarter as u64) << (octave + FIRST_BIN_BITS as usize - 2)
        }
    }
}

/// The lateness, nanoseconds, that a share `quantile` (0..=1) of the counted wake-ups does not exceed, rounded up to a
/// bin's edge; none if nothing was counted. The last bin has no upper edge: its lower one is returned.
#[must_use]
pub fn quantile_ns(histogram: &[u32; HISTOGRAM_BINS], quantile: f64) -> Option<u64> {
    let total: u64 = histogram.iter().map(|&count| u64::from(count)).sum();
    if total == 0 {
        return None;
    }
    let wanted = (quantile.clamp(0.0, 1.0) * total as f64).ceil().max(1.0) as u64;
    let mut seen = 0;
    let bin = histogram.iter().position(|&count| {
        seen += u64::from(count);
        seen >= wanted
    })?;
    Some(lower_edge_ns(bin + 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_edge_falls_into_its_own_bin_and_the_value_before_it_into_the_one_before() {
        for bin in 1..HISTOGRAM_BINS {
            let edge = lower_edge_ns(bin);
            assert_eq!(bin_of(edge), bin);
            assert_eq!(bin_of(edge - 1), bin - 1);
        }
        assert_eq!(bin_of(0), 0);
        assert_eq!(bin_of(u64::MAX), HISTOGRAM_BINS - 1);
        assert!(lower_edge_ns(HISTOGRAM_BINS - 1) > 40_000_000);
    }

    #[test]
    fn quantiles_bound_the_counted_values_from_above() {
        let mut histogram = [0; HISTOGRAM_BINS];
        assert_eq!(quantile_ns(&histogram, 0.5), None);
        for _ in 0..99 {
            histogram[bin_of(20_000)] += 1;
        }
        histogram[bin_of(3_000_000)] += 1;
        let median = quantile_ns(&histogram, 0.5).unwrap();
        assert!((20_000..25_000).contains(&median), "{median}");
        assert_eq!(quantile_ns(&histogram, 0.99), Some(median));
        assert!(quantile_ns(&histogram, 1.0).unwrap() > 3_000_000);
    }
}
