//! Numbers of the command line.

use clap::builder::RangedU64ValueParser;
use shared_types::capacity::MAX_CANDIDATES;

/// Reads a number that is neither infinite nor NaN, for `value_parser`.
pub(crate) fn finite(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        _ => Err("a finite number is needed".to_owned()),
    }
}

/// Reads a share, above 0 and at most 1.
pub(crate) fn share(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if number > 0.0 && number <= 1.0 => Ok(number),
        _ => Err("a number above 0 and at most 1 is needed".to_owned()),
    }
}

/// Reads a number of candidates.
pub(crate) fn candidates() -> RangedU64ValueParser<usize> {
    RangedU64ValueParser::new().range(1..=MAX_CANDIDATES as u64)
}

/// Reads a number of worker threads; 0 stands for one a core.
pub(crate) fn threads() -> RangedU64ValueParser<usize> {
    RangedU64ValueParser::new().range(0..=256)
}
