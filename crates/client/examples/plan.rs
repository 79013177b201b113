//! Has a motion to a tip planned and executed, and waits for its result: `plan X Y Z`, metres in the base frame.

use std::error::Error;
use std::time::Duration;

use client::{Client, ResultView};
use shared_types::ipc::IpcOptions;
use shared_types::valid::{Goal, PlanRequest};

fn main() -> Result<(), Box<dyn Error>> {
    let [x, y, z] = [1, 2, 3].map(|i| std::env::args().nth(i).unwrap_or_default());
    let options = IpcOptions::from_env();
    let (mut client, mut results) = (Client::connect(&options)?, ResultView::connect(&options)?);
    let mut request = PlanRequest::from_robot(Goal::tip([x.parse()?, y.parse()?, z.parse()?]));
    (request.candidate_count, request.execute) = (10, true);
    let answer = client.plan(&request, Duration::from_secs(5))?;
    println!("{}", answer.report());
    let id = answer.report().trajectory_id.ok_or("nothing is executed")?;
    let result = results.wait_for(id, Duration::from_secs(60))?;
    println!("trajectory {id}: {}", result.ok_or("no result came")?);
    Ok(())
}
