//! What both programs do at their begin and at their end.

use std::{
    fmt::Display,
    io::{IsTerminal, stderr},
    process::ExitCode,
};

use tracing_subscriber::EnvFilter;

/// Logs to standard error: what `RUST_LOG` says, `info` without it; in colour on a terminal only.
pub fn start_logging() {
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new("info"));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_ansi(stderr().is_terminal())
        .with_writer(stderr)
        .init();
}

/// The exit code of `program`: 0, or 1 after the reason on standard error.
pub fn exit_code<E: Display>(program: &str, result: Result<(), E>) -> ExitCode {
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{program}: {error:#}");
            ExitCode::FAILURE
        }
    }
}
