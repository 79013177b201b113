//! What `pcc` and restarts take beside another user.

use std::time::{Duration, Instant};

use shared_types::codes::LoopFault;
use tests::other_user::OwnersRobot;

use crate::report::Report;

pub(super) const PARTS: [&str; 3] = ["planner-daemon", "controller", "simulated-robot"];
pub(super) const PATIENCE: Duration = Duration::from_secs(60);
pub(super) const PLAN: &[&str] = &[
    "plan",
    "--tip",
    "0.8",
    "0.2",
    "2.7",
    "--sampler",
    "straight",
];
pub(super) const MOTIONS: [&[&str]; 2] = [
    &[
        "plan",
        "--tip",
        "0.8",
        "0.2",
        "2.7",
        "--sampler",
        "straight",
        "--execute",
    ],
    &[
        "plan",
        "--tip",
        "-0.8",
        "0.4",
        "2.6",
        "--sampler",
        "straight",
        "--execute",
    ],
];
const WATCH: &[&str] = &["watch", "--rate-hz", "100", "--times", "3"];
/// Faults that a controller latches when its robot is killed.
const ROBOT_GONE: [LoopFault; 2] = [LoopFault::RobotLost, LoopFault::RobotRampedToRest];
/// What a measurement tries.
const STEPS: [&str; 6] = [
    "pcc stop",
    "pcc plan",
    "a new pcc watch",
    "restart of the daemon",
    "restart of the controller",
    "restart of the robot",
];
/// How much longer than usual `pcc` may take among false names, and how much longer a restart may.
const PCC_MORE: Duration = Duration::from_millis(300);
const RESTART_MORE: Duration = Duration::from_secs(1);

/// What `pcc` and restarts take, how often they were tried in vain, and what was wrong with a stop.
#[derive(Clone, Debug, Default)]
pub(super) struct Times {
    stop: Duration,
    plan: Duration,
    watch: Duration,
    restarts: [Duration; 3],
    /// Tries that failed before one succeeded, of each of [`STEPS`].
    failed: [usize; 6],
    /// Processes that had ended by themselves after a restart.
    pub(super) ended: Vec<String>,
    /// A `pcc stop` that failed while the robot moved, or after which it went on.
    pub(super) not_stopped: Vec<String>,
}

impl Times {
    pub(super) fn measure(robot: &mut OwnersRobot) -> anyhow::Result<Self> {
        let plan = robot.until_it_works(PLAN, PATIENCE)?;
        let watch = robot.until_it_works(WATCH, PATIENCE)?;
        let stop = robot.stop_in_motion(MOTIONS, PATIENCE)?;
        let mut not_stopped = Vec::from_iter(stop.refusal);
        if stop.to_rest.is_none() {
            not_stopped.push("the robot goes on".to_owned());
        }
        let mut times = Self {
            plan: plan.took,
            stop: stop.took,
            watch: watch.took,
            restarts: [Duration::ZERO; 3],
            failed: [stop.failed_motions, plan.failed, watch.failed, 0, 0, 0],
            ended: Vec::new(),
            not_stopped,
        };
        for (index, part) in PARTS.into_iter().enumerate() {
            times.restart(robot, index, part)?;
        }
        Ok(times)
    }

    /// Until the daemon plans and the controller holds the robot again.
    fn restart(
        &mut self,
        robot: &mut OwnersRobot,
        index: usize,
        part: &'static str,
    ) -> anyhow::Result<()> {
        let begin = Instant::now();
        robot.start(part);
        let tried = robot.until_it_works(PLAN, PATIENCE)?;
        let by_right: &[LoopFault] = match part {
            "simulated-robot" => &ROBOT_GONE,
            _ => &[],
        };
        robot.until_holding(PATIENCE, by_right)?;
        self.restarts[index] = begin.elapsed();
        self.failed[3 + index] = tried.failed;
        let ended = robot.ended();
        let after = |name: String| format!("{name}, after a restart of {part}");
        self.ended.extend(ended.into_iter().map(after));
        Ok(())
    }

    /// The longer of each, and all that was wrong.
    pub(super) fn longest(mut self, other: Self) -> Self {
        let longer = |a: Duration, b: Duration| a.max(b);
        self.not_stopped.extend(other.not_stopped);
        self.ended.extend(other.ended);
        Self {
            stop: longer(self.stop, other.stop),
            plan: longer(self.plan, other.plan),
            watch: longer(self.watch, other.watch),
            restarts: std::array::from_fn(|i| longer(self.restarts[i], other.restarts[i])),
            failed: std::array::from_fn(|i| self.failed[i].max(other.failed[i])),
            ended: self.ended,
            not_stopped: self.not_stopped,
        }
    }

    /// Each by its name, and how much longer than usual it may be.
    pub(super) fn all(&self) -> [(&'static str, Duration, Duration); 6] {
        let [daemon, controller, robot] = self.restarts;
        let took = [self.stop, self.plan, self.watch, daemon, controller, robot];
        let more = [
            PCC_MORE,
            PCC_MORE,
            PCC_MORE,
            RESTART_MORE,
            RESTART_MORE,
            RESTART_MORE,
        ];
        std::array::from_fn(|i| (STEPS[i], took[i], more[i]))
    }

    /// No step may have failed more often than without another user.
    pub(super) fn tell_failed(&self, report: &mut Report, about: &str, usual: &Self) {
        for (index, step) in STEPS.into_iter().enumerate() {
            let (failed, usually) = (self.failed[index], usual.failed[index]);
            let name = format!("defect 9: {step} {about}, tries that failed (usual: {usually})");
            report.at_most(&name, failed as f64, usually as f64);
        }
        let name = format!("defect 9: processes that ended by themselves, {about}");
        report.none_of(&name, &self.ended);
    }
}
