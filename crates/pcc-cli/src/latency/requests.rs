//! What is asked for: tips that the daemon's robot can reach, from the straight robot.

use std::f64::consts::PI;
use std::time::{Duration, Instant};

use anyhow::bail;
use pcc_model::{Backbone, Configuration};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use shared_types::capacity::DOF;
use shared_types::ipc::{
    IpcNode, IpcOptions, newest, observer_subscriber, robot_description_service,
};
use shared_types::message::RobotDescription;
use shared_types::valid::{Goal, PlanRequest};

/// Different requests.
const COUNT: usize = 64;
/// Share of the bending limit up to which the sections of a tip's configuration are bent.
const BENT: f64 = 0.9;
/// How long the daemon may take to describe its robot.
const TIMEOUT: Duration = Duration::from_secs(2);

/// The daemon's robot, as it describes it.
pub(super) fn robot(options: &IpcOptions) -> anyhow::Result<RobotDescription> {
    let node = IpcNode::create(options, "pcc-latency")?;
    let descriptions = observer_subscriber(&node, &robot_description_service(&node)?)?;
    let begun = Instant::now();
    loop {
        if let Some(robot) = newest(&descriptions) {
            let limit = robot.bending_limit_rad;
            anyhow::ensure!(
                limit > 0.0 && limit <= PI,
                "the daemon's robot bends by {limit} rad; up to π is possible"
            );
            return Ok(robot);
        }
        if begun.elapsed() > TIMEOUT {
            bail!("the daemon has not described its robot within {TIMEOUT:?}");
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Requests to random tips, the same for the same robot and seed.
pub(super) fn draw(
    robot: &RobotDescription,
    candidates: usize,
    deadline_ms: u64,
    seed: u64,
) -> Vec<PlanRequest> {
    let mut random = Pcg64::seed_from_u64(seed);
    let limit = BENT * robot.bending_limit_rad / 2.0_f64.sqrt();
    let request = |index: usize| {
        let bent = Configuration::from_fn(|_, _| random.random_range(-limit..limit));
        let tip = Backbone::tip_of(&robot.section_lengths_m, &bent);
        PlanRequest {
            candidate_count: candidates,
            deadline: Some(Duration::from_millis(deadline_ms)),
            ignores_live_scene: true,
            seed: seed.wrapping_add(index as u64),
            ..PlanRequest::new([0.0; DOF], Goal::tip(tip.into()))
        }
    };
    (0..COUNT).map(request).collect()
}
