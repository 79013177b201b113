//! What is asked for: tips that the daemon's robot can reach, from the straight robot.

use std::f64::consts::PI;
use std::time::{Duration, Instant};

use anyhow::bail;
use pcc_model::{Backbone, Configuration, SECTIONS};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use shared_types::capacity::DOF;
use shared_types::ipc::{
    IpcNode, IpcOptions, newest, observer_subscriber, robot_description_service,
};
use shared_types::message::RobotDescription;
use shared_types::valid::{Goal, PlanRequest};

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

/// Requests to random tips, each drawn when it is asked for: the same for the same robot, seed and number.
pub(super) struct Requests {
    section_lengths_m: [f64; SECTIONS],
    /// Bound on each bending component, rad.
    bent_rad: f64,
    pub(super) candidates: usize,
    pub(super) deadline_ms: u64,
    pub(super) seed: u64,
}

impl Requests {
    pub(super) fn new(
        robot: &RobotDescription,
        candidates: usize,
        deadline_ms: u64,
        seed: u64,
    ) -> Self {
        Self {
            section_lengths_m: robot.section_lengths_m,
            bent_rad: BENT * robot.bending_limit_rad / 2.0_f64.sqrt(),
            candidates,
            deadline_ms,
            seed,
        }
    }

    /// The request of a number, counted from 0.
    pub(super) fn request(&self, index: u64) -> PlanRequest {
        let mut random = Pcg64::seed_from_u64(self.seed);
        // A bending component takes one number of the generator.
        random.advance(u128::from(index) * DOF as u128);
        let limit = self.bent_rad;
        let bent = Configuration::from_fn(|_, _| random.random_range(-limit..limit));
        let tip = Backbone::tip_of(&self.section_lengths_m, &bent);
        PlanRequest {
            candidate_count: self.candidates,
            deadline: Some(Duration::from_millis(self.deadline_ms)),
            ignores_live_scene: true,
            seed: self.seed.wrapping_add(index),
            ..PlanRequest::new([0.0; DOF], Goal::tip(tip.into()))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn requests(seed: u64) -> Requests {
        let robot = RobotDescription {
            section_lengths_m: [1.0; SECTIONS],
            bending_limit_rad: 1.5,
            ..RobotDescription::ZEROED
        };
        Requests::new(&robot, 10, 1_000, seed)
    }

    #[test]
    fn requests_of_other_numbers_are_others_and_of_the_same_number_and_seed_the_same() {
        let all = requests(3);
        let tips: Vec<Goal> = (0..2_000).map(|index| all.request(index).goal).collect();
        for (index, tip) in tips.iter().enumerate() {
            assert!(!tips[..index].contains(tip), "request {index}");
        }
        assert_eq!(requests(3).request(7_000), all.request(7_000));
        assert_ne!(requests(4).request(7_000).goal, all.request(7_000).goal);
    }
}
