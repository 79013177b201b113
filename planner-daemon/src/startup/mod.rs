//! The start of the daemon: its settings, and what is loaded, checked and opened before the first request.

mod config;
mod daemon;
mod process;
mod warm_up;

pub use config::{Config, ConfigError};
pub use daemon::{Daemon, StartError};
pub use process::termination_flag;
