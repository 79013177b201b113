//! Numbers of the command line: each option has its range, which an error message states.

use crate::command_line::shown_value;
use anyhow::ensure;
use clap::builder::TypedValueParser;
use clap::error::ErrorKind;
use clap::{Arg, Command, Error};
use shared_types::capacity::{MAX_BALLS, MAX_CANDIDATES};
use shared_types::valid::{LEAST_LIMITS_SCALE, MAX_LENGTH_M};
use std::f64::consts::PI;
use std::ffi::OsStr;
use std::str::FromStr;

/// Most worker threads.
const MOST_THREADS: usize = 256;

/// Reads a number of a closed range.
#[derive(Clone)]
pub(crate) struct Number<T> {
    least: T,
    most: T,
    /// The range in words, for the error message.
    allowed: String,
}

impl<T> TypedValueParser for Number<T>
where
    T: FromStr + PartialOrd + Clone + Send + Sync + 'static,
{
    type Value = T;

    fn parse_ref(&self, command: &Command, option: Option<&Arg>, text: &OsStr) -> Result<T, Error> {
        let number = text.to_str().and_then(|text| text.parse().ok());
        number
            .filter(|number| (&self.least..=&self.most).contains(&number))
            .ok_or_else(|| refused(command, option, text, &self.allowed))
    }
}

/// An error that names an option, its value, and the allowed values.
pub(crate) fn refused(
    command: &Command,
    option: Option<&Arg>,
    text: &OsStr,
    allowed: &str,
) -> Error {
    let option = option.map(ToString::to_string).unwrap_or_default();
    let text = shown_value(text);
    let message = format!("invalid value '{text}' for '{option}': {allowed} is needed");
    Error::raw(ErrorKind::ValueValidation, message).format(&mut command.clone())
}

/// Reads a whole number of a closed range.
pub(crate) fn whole<T: ToString>(least: T, most: T) -> Number<T> {
    let allowed = format!(
        "a whole number from {} to {}",
        least.to_string(),
        most.to_string()
    );
    Number {
        least,
        most,
        allowed,
    }
}

/// Reads a real number of a closed range; `unit` is what follows it in the message.
pub(crate) fn real(least: f64, most: f64, unit: &str) -> Number<f64> {
    let allowed = format!("a number from {least} to {most}{unit}");
    Number {
        least,
        most,
        allowed,
    }
}

/// A coordinate of a tip in metres.
pub(crate) fn metres() -> Number<f64> {
    real(-MAX_LENGTH_M, MAX_LENGTH_M, " m")
}

/// A bending component in radians: no robot bends farther.
pub(crate) fn radians() -> Number<f64> {
    Number {
        least: -PI,
        most: PI,
        allowed: "a number from -π to π rad".to_owned(),
    }
}

/// A share of the tendon limits.
pub(crate) fn limits_scale() -> Number<f64> {
    Number {
        least: LEAST_LIMITS_SCALE,
        most: 1.0,
        allowed: format!("a number from {LEAST_LIMITS_SCALE:e} to 1"),
    }
}

/// A number of candidates.
pub(crate) fn candidates() -> Number<usize> {
    whole(1, MAX_CANDIDATES)
}

/// A number of worker threads; 0 stands for one a core.
pub(crate) fn threads() -> Number<usize> {
    whole(0, MOST_THREADS)
}

/// A seed, or a count whose 0 stands for no end.
pub(crate) fn any() -> Number<u64> {
    whole(0, u64::MAX)
}

/// One part of a data set, made on its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Shard {
    /// Number of the part, from 0.
    pub(crate) index: u64,
    /// Number of parts of the set.
    pub(crate) count: u64,
}

/// Reads a shard as `i/n`, for `value_parser`.
pub(crate) fn shard(text: &str) -> Result<Shard, &'static str> {
    let read = || {
        let (index, count) = text.split_once('/')?;
        let (index, count) = (index.parse().ok()?, count.parse().ok()?);
        (index < count).then_some(Shard { index, count })
    };
    read().ok_or("two whole numbers i/n, the first below the second, are needed, like 0/4")
}

/// The balls of `--ball`, four values each; an error where there are too many, or a radius is out of range.
pub(crate) fn balls_of(values: &[f64], largest: f64, unit: &str) -> anyhow::Result<Vec<[f64; 4]>> {
    let balls = values.as_chunks().0.to_vec();
    let count = balls.len();
    ensure!(
        count <= MAX_BALLS,
        "{count} of --ball: at most {MAX_BALLS} are allowed"
    );
    for ball in &balls {
        ensure!(
            (0.0..=largest).contains(&ball[3]),
            "--ball {}: a radius of 0 to {largest} {unit} is needed",
            spaced(ball)
        );
    }
    Ok(balls)
}

/// Values as they are written on the command line.
pub(crate) fn spaced(values: &[f64]) -> String {
    let values: Vec<String> = values.iter().map(|value| format!("{value:?}")).collect();
    values.join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_is_of_its_range_or_refused_with_it() {
        let command = Command::new("pcc");
        let option = Arg::new("candidates").long("candidates").num_args(1);
        let read = |text: &str| candidates().parse_ref(&command, Some(&option), text.as_ref());
        assert_eq!(read("64").unwrap(), 64);
        for text in ["0", "65", "", "1.5", "nan", "18446744073709551616"] {
            let said = read(text).unwrap_err().to_string();
            for part in [text, "--candidates", "a whole number from 1 to 64"] {
                assert!(said.contains(part), "{said}");
            }
        }
    }

    #[test]
    fn no_number_is_not_finite() {
        let command = Command::new("pcc");
        for text in ["nan", "inf", "-inf", "1e309", "1001"] {
            metres()
                .parse_ref(&command, None, text.as_ref())
                .unwrap_err();
        }
        assert_eq!(
            metres().parse_ref(&command, None, "-1e3".as_ref()).unwrap(),
            -1e3
        );
    }

    #[test]
    fn a_shard_is_below_their_number() {
        assert_eq!(shard("0/1"), Ok(Shard { index: 0, count: 1 }));
        for text in ["", "1", "1/1", "-1/2", "0/0", "0/x", "0/1/2"] {
            shard(text).unwrap_err();
        }
    }

    #[test]
    fn a_ball_has_no_negative_radius() {
        assert_eq!(balls_of(&[1.0; 8], 2.0, "m").unwrap(), [[1.0; 4]; 2]);
        let said = balls_of(&[0.5, 0.0, 0.0, -1.0], 2.0, "m")
            .unwrap_err()
            .to_string();
        assert_eq!(
            said,
            "--ball 0.5 0.0 0.0 -1.0: a radius of 0 to 2 m is needed"
        );
        balls_of(&[0.0; 4 * 65], 2.0, "m").unwrap_err();
    }
}
