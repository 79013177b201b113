//! `simulated-robot`: stands in for the motors and the arm.

use std::{
    path::PathBuf,
    process::ExitCode,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread,
};

use anyhow::Context;
use clap::Parser;
use controller::robot::{RobotConfig, Switches, run};
use shared_types::ipc::IpcOptions;
use signal_hook::{
    consts::{SIGINT, SIGTERM, SIGUSR1, SIGUSR2},
    iterator::Signals,
};
use tracing::warn;

/// Simulates the robot: motors with limits, backlash and noise, driven by the controller's set-points.
///
/// It refuses set-points that its motors could not follow, and ramps to rest by itself after 20 ms without one. After a
/// kill it still stands where it stood; after a clean exit the next one stands at its start configuration. One robot
/// runs per prefix.
///
/// Environment: PCC_PREFIX (default pcc) and PCC_ROOT (default ~/.pcc-services where that exists, else
/// /dev/shm/pcc-UID) name the robot's shared memory; RUST_LOG sets the log level on stderr (default info). SIGTERM and
/// SIGINT end it with exit 0 once its tendons have come to rest. For tests, SIGUSR1 makes one motor stick (and free again), SIGUSR2 stops (and restarts)
/// the publishing of its state.
#[derive(Parser)]
#[command(version, verbatim_doc_comment)]
struct Arguments {
    /// Configuration file (TOML; every setting is explained in the shipped one).
    #[arg(
        long,
        value_name = "FILE",
        default_value = "config/simulated-robot.toml"
    )]
    config: PathBuf,
}

fn main() -> ExitCode {
    logging::exit_code("simulated-robot", start())
}

fn start() -> anyhow::Result<()> {
    let arguments = Arguments::parse();
    logging::start().context("cannot start to log")?;
    let config = RobotConfig::from_file(&arguments.config)?;
    let switches = Switches::default();
    listen_to_signals(&switches)?;
    run(&config, &IpcOptions::from_env(), &switches)?;
    Ok(())
}

fn listen_to_signals(switches: &Switches) -> anyhow::Result<()> {
    let mut signals =
        Signals::new([SIGTERM, SIGINT, SIGUSR1, SIGUSR2]).context("cannot handle signals")?;
    let switches = switches.clone();
    let turn = |switch: &Arc<AtomicBool>| !switch.fetch_xor(true, Ordering::Relaxed);
    thread::spawn(move || {
        for signal in &mut signals {
            match signal {
                SIGUSR1 => warn!(stuck = turn(&switches.stuck), "injected fault"),
                SIGUSR2 => warn!(mute = turn(&switches.mute), "injected fault"),
                _ => switches.shutdown.store(true, Ordering::Relaxed),
            }
        }
    });
    Ok(())
}
