//! Files of settings: TOML, read as a type, and checked key by key.

use crate::file::{InputFileError, read_text};
use crate::text::{shortened, shown};
use serde::de::{DeserializeOwned, IntoDeserializer};
use serde::{Deserialize, Deserializer};
use std::borrow::Cow;
use std::fmt::Display;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Longest file of settings that is read, bytes.
pub const MAX_SETTINGS_BYTES: u64 = 1 << 20;

/// Why a file of settings is refused.
#[derive(Debug, Error)]
pub enum SettingsError {
    /// The file is not read.
    #[error(transparent)]
    File(#[from] InputFileError),
    /// The file is not TOML, a key is missing or unknown, or a value has the wrong type.
    #[error("{} is not understood: {}", shown(.path), readable(.fault))]
    Syntax {
        /// The file.
        path: PathBuf,
        /// TOML's own error: place and fault. The message tells it, so that it is not the error's source.
        fault: Box<toml::de::Error>,
    },
    /// A value is outside its range.
    #[error("{}: {key} = {value} is not allowed: {allowed}", shown(.path))]
    Range {
        /// The file.
        path: PathBuf,
        /// The key.
        key: Cow<'static, str>,
        /// The key's value.
        value: String,
        /// What is allowed.
        allowed: String,
    },
}

/// A file of settings, against which single values are checked.
#[derive(Clone, Copy, Debug)]
pub struct SettingsFile<'a> {
    /// Path of the file.
    pub path: &'a Path,
}

impl SettingsFile<'_> {
    /// Reads the file as `T`.
    ///
    /// # Errors
    /// [`SettingsError`], naming the file, the key or the line, and what is allowed.
    pub fn read<T: DeserializeOwned>(&self) -> Result<T, SettingsError> {
        self.parse(&read_text(self.path, MAX_SETTINGS_BYTES)?)
    }

    /// Takes `text` as the file's content.
    ///
    /// # Errors
    /// [`SettingsError::Syntax`].
    pub fn parse<T: DeserializeOwned>(&self, text: &str) -> Result<T, SettingsError> {
        toml::from_str(text).map_err(|fault| SettingsError::Syntax {
            path: self.path.into(),
            fault: Box::new(fault),
        })
    }

    /// Refuses the value of a key unless `holds`.
    ///
    /// # Errors
    /// [`SettingsError::Range`].
    pub fn require(
        &self,
        holds: bool,
        key: impl Into<Cow<'static, str>>,
        value: impl Display,
        allowed: impl Into<String>,
    ) -> Result<(), SettingsError> {
        if holds {
            return Ok(());
        }
        Err(SettingsError::Range {
            path: self.path.into(),
            key: key.into(),
            value: value.to_string(),
            allowed: allowed.into(),
        })
    }

    /// Refuses the value of a key unless it is in a range.
    ///
    /// # Errors
    /// [`SettingsError::Range`].
    pub fn within<T: PartialOrd + Display>(
        &self,
        key: impl Into<Cow<'static, str>>,
        value: T,
        range: RangeInclusive<T>,
    ) -> Result<(), SettingsError> {
        let allowed = format!("{} to {}", range.start(), range.end());
        self.require(range.contains(&value), key, value, allowed)
    }
}

/// Declares the type that a file of settings is read as: keys that are needed (or optional by their type), then keys with defaults.
/// Unknown keys are refused. The crate that calls this depends on serde.
#[macro_export]
macro_rules! settings_file {
    ($(#[$attribute:meta])* struct $name:ident {
        $($needed:ident: $needed_type:ty,)*
    } defaults {
        $($key:ident: $type:ty = $default:expr,)*
    }) => {
        $(#[$attribute])*
        struct $name { $($needed: $needed_type,)* $($key: $type,)* }

        impl<'de> serde::Deserialize<'de> for $name {
            fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                #[derive(serde::Deserialize)]
                #[serde(deny_unknown_fields)]
                struct $name { $($needed: $needed_type,)* $($key: Option<$type>,)* }

                let given = $name::deserialize(deserializer)?;
                Ok(Self {
                    $($needed: given.$needed,)*
                    $($key: given.$key.unwrap_or($default),)*
                })
            }
        }
    };
}

/// Reads one of the names of an enumeration, for `#[serde(deserialize_with)]`: what is refused of any type is told with what is expected,
/// which a parser of TOML does not do.
///
/// # Errors
/// The parser's.
pub fn named<'de, T: DeserializeOwned, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<T, D::Error> {
    T::deserialize(String::deserialize(deserializer)?.into_deserializer())
}

/// What a parser says, and what is allowed where it does not say so.
#[must_use]
pub fn readable(error: &toml::de::Error) -> String {
    let said = shortened(error.to_string().trim_end());
    match error.message() {
        "duplicate key" => said + "; each key is allowed once",
        _ => said,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;
    use std::fs;

    crate::settings_file! {
        #[derive(Debug, PartialEq)]
        struct Declared {
            robot: String,
            scene: Option<String>,
        }
        defaults {
            rate_hz: u32 = 1000,
            processors: Vec<usize> = vec![3],
        }
    }

    #[test]
    fn keys_that_are_left_out_have_their_defaults() {
        let read: Declared = file().parse("robot = \"a\"\nprocessors = []").unwrap();
        let expected = Declared {
            robot: "a".to_owned(),
            scene: None,
            rate_hz: 1000,
            processors: Vec::new(),
        };
        assert_eq!(read, expected);
    }

    #[test]
    fn declared_settings_are_refused_like_those_of_a_derived_type() {
        #[derive(Debug, serde::Deserialize)]
        #[serde(deny_unknown_fields, rename = "Declared")]
        #[expect(dead_code, reason = "only its errors count")]
        struct Derived {
            robot: String,
            scene: Option<String>,
            #[serde(default)]
            rate_hz: u32,
            #[serde(default)]
            processors: Vec<usize>,
        }
        for text in [
            "",
            "rate_hz = 5",
            "robot = 5",
            "robot = \"a\"\nrate_hz = \"x\"",
            "robot = \"a\"\nrate_hz = -1",
            "robot = \"a\"\nrate_hz = [1]",
            "robot = \"a\"\nprocessors = [1, \"x\"]",
            "robot = \"a\"\nprocessors = 1",
            "robot = \"a\"\nscene = 1",
            "robot = \"a\"\nspeed = 1",
            "robot = \"a\"\n[rate_hz]\nx = 1",
            "robot = \"a\"\nrobot = \"b\"",
        ] {
            let declared = file().parse::<Declared>(text).unwrap_err().to_string();
            let derived = file().parse::<Derived>(text).unwrap_err().to_string();
            assert_eq!(declared, derived);
        }
    }

    fn file() -> SettingsFile<'static> {
        SettingsFile {
            path: Path::new("a.toml"),
        }
    }

    #[test]
    fn a_file_is_read_as_a_type() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.toml");
        fs::write(&path, "rate_hz = 5").unwrap();
        let read: BTreeMap<String, u32> = SettingsFile { path: &path }.read().unwrap();
        assert_eq!(read["rate_hz"], 5);
    }

    #[test]
    fn what_is_refused_is_told_with_file_key_value_and_what_is_allowed() {
        let error = file().within("rate_hz", 7, 100..=400).unwrap_err();
        let said = "\"a.toml\": rate_hz = 7 is not allowed: 100 to 400";
        assert_eq!(error.to_string(), said);
        assert!(file().within("rate_hz", 100, 100..=400).is_ok());
        let nan = file().within("noise", f64::NAN, 0.0..=1.0).unwrap_err();
        assert!(nan.to_string().contains("noise = NaN"), "{nan}");
        let wrong = file().parse::<BTreeMap<String, u32>>("rate_hz = \"x\"");
        let wrong = wrong.unwrap_err().to_string();
        for part in ["a.toml", "line 1", "rate_hz = \"x\"", "expected u32"] {
            assert!(wrong.contains(part), "{part}: {wrong}");
        }
    }

    #[test]
    fn of_a_long_line_both_ends_are_quoted() {
        let text = format!("rate_hz = \"{}\"", "x".repeat(100_000));
        let wrong = file().parse::<BTreeMap<String, u32>>(&text);
        let wrong = wrong.unwrap_err().to_string();
        assert!(wrong.len() < 1500, "{} bytes", wrong.len());
        for part in ["rate_hz = \"x", "expected u32"] {
            assert!(wrong.contains(part), "{part}: {wrong}");
        }
    }
}
