//! The planner daemon's program.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, anyhow};
use clap::Parser;
use planner_daemon::{Config, Daemon, termination_flag};
use shared_types::ipc::IpcOptions;

/// Answers plan requests over shared memory and publishes motions for execution.
///
/// It serves under the prefix PCC_PREFIX (default pcc) and the directory PCC_ROOT (default ~/.pcc-services where that
/// exists, else /dev/shm/pcc-UID), which clients, controller and robot must share. One daemon runs under a prefix.
/// SIGTERM and SIGINT end it after it has answered what is under way; after SIGKILL it can be started again at once.
/// Logs go to standard error; RUST_LOG says how much (error, warn, info, debug). It exits with 0 when it is ended by a
/// signal, and with 1 and the reason when it cannot start. A panic of a thread that does not plan aborts it (SIGABRT).
#[derive(Parser)]
#[command(version, verbatim_doc_comment)]
struct Arguments {
    /// Configuration file (TOML); the shipped config/planner-daemon.toml explains every setting.
    #[arg(long, value_name = "FILE")]
    config: PathBuf,
}

fn main() -> ExitCode {
    logging::exit_code("planner-daemon", serve(&Arguments::parse()))
}

fn serve(arguments: &Arguments) -> anyhow::Result<()> {
    logging::start().context("cannot start to log")?;
    let terminated = termination_flag().map_err(|e| anyhow!("cannot handle signals: {e}"))?;
    let config = Config::from_file(&arguments.config)?;
    let daemon = Daemon::start(&config, &IpcOptions::from_env());
    let path = arguments.config.display();
    let mut daemon = daemon.with_context(|| format!("configuration {path}"))?;
    daemon.run(&terminated);
    Ok(())
}
