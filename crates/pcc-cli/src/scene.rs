//! `pcc scene leave`: signs off a source of live scenes whose program will not come back.

use anyhow::anyhow;
use clap::{Args, Subcommand};
use client::{ClientError, ScenePublisher};
use shared_types::capacity::SOURCE_NAME_BYTES;
use shared_types::codes::SceneRefusal;
use shared_types::ipc::IpcOptions;
use shared_types::valid::SourceName;
use std::time::Duration;

/// Longest wait for the daemon's confirmation of a scene.
const TIMEOUT: Duration = Duration::from_secs(5);

/// Arguments of `pcc scene`.
#[derive(Args)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    action: Action,
}

#[derive(Subcommand)]
enum Action {
    /// Sign a source off whose program is gone: its obstacles are forgotten once their lifetime is over, and no scene of it is waited
    /// for any more.
    Leave {
        /// The source's name, as the daemon says it: 1 to 32 characters of printable ASCII.
        #[arg(value_parser = source_name)]
        source: String,
    },
}

fn source_name(text: &str) -> Result<String, String> {
    let needed = |_| format!("1 to {SOURCE_NAME_BYTES} characters of printable ASCII are needed");
    let name = SourceName::new(text).map_err(needed)?;
    Ok(name.to_string())
}

/// The daemon's refusal, with what it would take.
fn explained(error: ClientError) -> anyhow::Error {
    match error {
        ClientError::SceneRefused {
            refusal: SceneRefusal::NoSuchSource,
            ..
        } => anyhow!(
            "{error}; one that this daemon has heard and that has not taken its leave is needed"
        ),
        other => other.into(),
    }
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let Action::Leave { source } = &arguments.action;
    let mut publisher = ScenePublisher::connect(&IpcOptions::from_env(), source)?;
    // A verdict may be there before the scene's sending has returned.
    publisher
        .take_leave()
        .and_then(|()| publisher.confirm(TIMEOUT))
        .map_err(explained)?;
    say!("source {source:?} is signed off");
    Ok(())
}
