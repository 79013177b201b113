//! `pcc replay`: asks a daemon again what a record says it was asked, and checks recorded motions against a robot file.

mod completeness;
mod goals;
mod motions;
mod plans;
mod recording;

use std::path::PathBuf;

use anyhow::Context;
use clap::Args;
use pcc_model::Robot;
use shared_types::ipc::IpcOptions;

pub(crate) use self::motions::motion;
pub(crate) use self::recording::Recording;

/// Arguments of `pcc replay`.
#[derive(Args)]
pub(crate) struct Arguments {
    /// A file that `pcc record` wrote.
    file: PathBuf,
    /// Check the recorded motions and set-points against this robot file, and ask no daemon.
    #[arg(long, value_name = "FILE")]
    robot: Option<PathBuf>,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let recording = Recording::read(&arguments.file)?;
    if let Some(error) = &recording.cut_off {
        say!("the file ends early ({error}); what comes before is replayed");
    }
    if !recording.completeness.is_ended() {
        say!(
            "the recorder has not come to its end: whether messages are missing after the last one is not known"
        );
    }
    recording.completeness.check()?;
    match &arguments.robot {
        Some(file) => motions::check(&recording, &Robot::from_file(file)?),
        None => {
            goals::report(&recording);
            plans::ask_again(&recording, &IpcOptions::from_env())
                .with_context(|| arguments.file.display().to_string())
        }
    }
}
