//! `controller`: the hard loop between the planner daemon and the motors.

use std::{path::PathBuf, process::ExitCode, sync::Arc};

use anyhow::Context;
use clap::Parser;
use controller::{
    arena::LoopAllocator,
    service::{self, ControllerConfig, Signals},
};
use shared_types::ipc::IpcOptions;
use signal_hook::consts::{SIGINT, SIGTERM, SIGUSR1};

#[global_allocator]
static ALLOCATOR: LoopAllocator = LoopAllocator;

/// Turns certified trajectories into tendon set-points in a hard loop.
///
/// It waits for a robot's state, holds where the robot stands, and follows the trajectories that the planner daemon
/// publishes. It stops along the path when the daemon or the robot is lost, and latches faults until `pcc` (or any
/// client) sends a reset. One controller runs per prefix; robot, daemon and controller start in any order.
///
/// Environment: PCC_PREFIX (default pcc) and PCC_ROOT (default ~/.pcc-services where that exists, else
/// /dev/shm/pcc-UID) name the robot's shared memory; RUST_LOG sets the log level on stderr (default info). SIGTERM and
/// SIGINT stop the robot along its path, then exit 0 (1 where the loop is held and the robot is let go of);
/// SIGUSR1 stops it like `pcc stop`, without any service.
#[derive(Parser)]
#[command(version, verbatim_doc_comment)]
struct Arguments {
    /// Configuration file (TOML; every setting is explained in the shipped one).
    #[arg(long, value_name = "FILE", default_value = "config/controller.toml")]
    config: PathBuf,
}

fn main() -> ExitCode {
    logging::exit_code("controller", start())
}

fn start() -> anyhow::Result<()> {
    let arguments = Arguments::parse();
    logging::start().context("cannot start to log")?;
    let config = ControllerConfig::from_file(&arguments.config)?;
    let signals = Signals::default();
    for (signal, flag) in [
        (SIGTERM, &signals.shutdown),
        (SIGINT, &signals.shutdown),
        (SIGUSR1, &signals.stop),
    ] {
        signal_hook::flag::register(signal, Arc::clone(flag)).context("cannot handle signals")?;
    }
    service::run(config, &IpcOptions::from_env(), signals)?;
    Ok(())
}
