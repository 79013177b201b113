//! Numbers of the command line.

use clap::builder::RangedU64ValueParser;

/// Reads a number that is neither infinite nor NaN, for `value_parser`.
pub(crate) fn finite(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        _ => Err("a finite number is needed".to_owned()),
    }
}

/// Reads a number of worker threads; 0 stands for one a core.
pub(crate) fn threads() -> RangedU64ValueParser<usize> {
    RangedU64ValueParser::new().range(0..=256)
}
