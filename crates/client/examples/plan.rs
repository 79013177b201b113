//! Has a motion to a tip planned and executed, and waits for its result: `plan X Y Z`, metres in the base frame.

use std::error::Error;
use std::time::Duration;

use client::{Client, ResultView};
use shared_types::ipc::IpcOptions;
use shared_types::valid::{Goal, PlanRequest};

fn main() -> Result<(), Box<dyn Error>> {
    let told: Result<Vec<f64>, _> = std::env::args().skip(1).map(|it| it.parse()).collect();
    let Ok(tip_m) = <[f64; 3]>::try_from(told.unwrap_or_default()) else {
        eprintln!("usage: plan X Y Z, metres in the base frame");
        std::process::exit(2);
    };
    let options = IpcOptions::from_env();
    let (mut client, mut results) = (Client::connect(&options)?, ResultView::connect(&options)?);
    let mut request = PlanRequest::from_robot(Goal::tip(tip_m));
    (request.candidate_count, request.execute) = (10, true);
    let answer = client.plan(&request, Duration::from_secs(5))?;
    println!("{}", answer.report());
    let id = answer.report().trajectory_id.ok_or("nothing is executed")?;
    let result = results.wait_for(id, Duration::from_secs(60))?;
    println!("trajectory {id}: {}", result.ok_or("no result came")?);
    Ok(())
}
