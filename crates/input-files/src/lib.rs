//! The one place where a file that a user names is opened.
//!
//! Such a file may be anything: a pipe that nobody writes, a device without an end, a terabyte of zeros. Only regular files
//! are opened, without waiting, and at most as many bytes are read as the caller allows. A refusal names the
//! file, what it is, and what is allowed.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod file;
mod settings;
mod text;

pub use file::{InputFile, InputFileError, read_bytes, read_text};
pub use settings::{MAX_SETTINGS_BYTES, SettingsError, SettingsFile, named, readable};
pub use text::{shortened, shown};
