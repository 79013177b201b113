//! Plans as a client that is set up for a robot file, and says how that is answered and what the bytes of the knots that it received hash
//! to, by FNV-1a: `asks ROBOT_FILE`.

use std::path::PathBuf;
use std::time::Duration;

use anyhow::Context;
use client::Client;
use pcc_model::Robot;
use shared_types::ipc::IpcOptions;
use shared_types::valid::{Goal, PlanRequest};
use tests::fnv1a;

fn main() -> anyhow::Result<()> {
    let file = std::env::args().nth(1).context("a robot file is needed")?;
    let mut client = Client::connect(&IpcOptions::from_env())?;
    client.state_robot(Robot::from_file(&PathBuf::from(file))?.hash());
    let request = PlanRequest {
        candidate_count: 10,
        ..PlanRequest::new([0.0; 6], Goal::tip([1.0, 0.5, 2.3]))
    };
    let answer = client.plan(&request, Duration::from_secs(5))?;
    let report = answer.report();
    println!("{}: {}", report.outcome, report.reason);
    let count = answer.candidates().count();
    println!("{count} candidates {:016x}", fnv1a::of_knots(&answer));
    Ok(())
}
