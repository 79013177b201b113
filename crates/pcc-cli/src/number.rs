//! Numbers of the command line.

/// Reads a number that is neither infinite nor NaN, for `value_parser`.
pub(crate) fn finite(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        _ => Err("a finite number is needed".to_owned()),
    }
}
