//! Plans as a client that is set up for a robot file, and says how that is answered: `other-robot ROBOT_FILE`.

use std::path::PathBuf;
use std::time::Duration;

use anyhow::Context;
use client::Client;
use pcc_model::Robot;
use shared_types::ipc::IpcOptions;
use shared_types::valid::{Goal, PlanRequest};

fn main() -> anyhow::Result<()> {
    let file = std::env::args().nth(1).context("a robot file is needed")?;
    let mut client = Client::connect(&IpcOptions::from_env())?;
    client.state_robot(Robot::from_file(&PathBuf::from(file))?.hash());
    let request = PlanRequest::new([0.0; 6], Goal::tip([1.0, 0.5, 2.3]));
    let answer = client.plan(&request, Duration::from_secs(5))?;
    let report = answer.report();
    println!("{}: {}", report.outcome, report.reason);
    Ok(())
}
