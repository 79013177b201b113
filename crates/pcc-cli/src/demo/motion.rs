//! One motion of the demonstration: ask, choose, execute, wait, measure.

use super::controller_state::TIMEOUT;
use super::recording::Recording;
use super::session::{MotionOrder, Session, motion_timeout};
use anyhow::{Context, bail};
use client::PlanAnswer;
use collision::{Ball, Scene, minimum_clearance};
use pcc_model::{Configuration, Point, Robot};
use serde::Serialize;
use shared_types::clock::mono_now_ns;
use shared_types::codes::{LoopFault, LoopState, Outcome};
use shared_types::message;
use shared_types::valid::{Goal, PlanRequest, SelectionRule};
use std::time::Duration;
use trajectory::{Knot, Trajectory};

/// Candidates of every request, as in the paper.
const CANDIDATES: usize = 10;
/// Deadline of every request: long, since the demonstration is not about latency.
const DEADLINE: Duration = Duration::from_millis(500);
/// A motion that ends farther than this from its goal configuration was stopped before its end, rad.
const SAME_CONFIGURATION_RAD: f64 = 1e-5;
/// Allowed tip errors, section lengths: commanded, and as measured on the noisy robot.
pub(super) const ALLOWED_ERROR: [f64; 2] = [0.01, 0.03];
/// How long the robot holds after a motion.
pub(super) const HOLD: Duration = Duration::from_millis(1000);
/// The last part of a hold, over which the measured tip is averaged, ns.
const MEASURED_OVER_NS: i64 = 300_000_000;

/// The report of a finished motion, as `demo.json` holds it.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Report {
    pub(super) experiment: u32,
    pub(super) name: String,
    /// Id of the trajectory in records.
    pub(super) trajectory_id: u32,
    pub(super) requested_tip_m: [f64; 3],
    /// Tip of the commanded configuration at the end.
    pub(super) reached_tip_m: [f64; 3],
    /// Tip of the mean measured configuration while holding.
    pub(super) measured_tip_m: [f64; 3],
    pub(super) duration_s: f64,
    /// Smallest clearance of the whole body over the executed curve; none without obstacles.
    pub(super) minimum_clearance_m: Option<f64>,
    /// Largest change of a tendon between two successive set-points.
    pub(super) largest_setpoint_step_m: f64,
    pub(super) late_cycles: u32,
    pub(super) end_configuration_rad: [f64; 6],
}

/// How an execution ended.
pub(super) enum Execution {
    /// The trajectory was executed to its end.
    Done(Report),
    /// The controller stopped the robot along its path, before the trajectory's end.
    Stopped {
        trajectory_id: u32,
        fault: LoopFault,
    },
}

/// An order that the controller obeyed during a motion.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Order {
    pub(super) trajectory_id: u32,
    pub(super) stamp_ns: i64,
    /// `stop`, `speed` or `reset`.
    pub(super) order: &'static str,
    /// How long the motion would have taken without orders.
    pub(super) planned_s: f64,
}

/// One candidate of a plan, lengths in metres.
pub(super) struct Proposal {
    pub(super) index: usize,
    pub(super) end: Configuration,
    motion: Trajectory,
}

/// A motion to demonstrate: its goal, and the balls that it must avoid.
pub(super) struct Task<'a> {
    pub(super) experiment: u32,
    pub(super) name: &'a str,
    pub(super) goal: Goal,
    pub(super) balls: &'a [Ball],
}

impl Session<'_> {
    /// Plans from where the controller holds, lets `choose` pick among the candidates, and executes that one.
    pub(super) fn perform(
        &mut self,
        task: &Task,
        recording: &Recording,
        choose: impl Fn(&[Proposal]) -> anyhow::Result<usize>,
    ) -> anyhow::Result<Execution> {
        let begun = self.hold()?;
        let request = self.request(begun.values.commanded_configuration_rad, task);
        let (proposals, hash) = self.propose(&request)?;
        let chosen = &proposals[choose(&proposals)?];
        let since = mono_now_ns();
        let id = self.execute(&request, chosen, hash)?;
        let ended = self.follow(
            id,
            motion_timeout(chosen.motion.duration(), begun.values.speed),
        )?;
        let end = Configuration::from(ended.values.commanded_configuration_rad);
        if ended.state == LoopState::Fault || (end - chosen.end).norm() > SAME_CONFIGURATION_RAD {
            return Ok(Execution::Stopped {
                trajectory_id: id,
                fault: ended.fault,
            });
        }
        std::thread::sleep(HOLD);
        let cycles = recording.since(since)?;
        let mean = mean_measured(&cycles)?;
        let scene = Scene::new(task.balls.to_vec())?;
        Ok(Execution::Done(Report {
            experiment: task.experiment,
            name: task.name.into(),
            trajectory_id: id,
            requested_tip_m: goal_tip(self.robot, &task.goal).into(),
            reached_tip_m: self.robot.tip(&end).into(),
            measured_tip_m: self.robot.tip(&mean).into(),
            duration_s: chosen.motion.duration(),
            minimum_clearance_m: (!scene.is_empty())
                .then(|| minimum_clearance(self.robot, &scene, &chosen.motion, 1e-4)),
            largest_setpoint_step_m: largest_step(&cycles),
            late_cycles: ended
                .values
                .late_cycles
                .saturating_sub(begun.values.late_cycles),
            end_configuration_rad: end.into(),
        }))
    }

    /// Plans from where the controller holds, executes the first candidate, and gives each order when its share of the motion is
    /// done; returns the orders that were obeyed once the robot rests.
    pub(super) fn perform_with_orders(
        &mut self,
        task: &Task,
        orders: &[(f64, MotionOrder)],
    ) -> anyhow::Result<Vec<Order>> {
        let begun = self.hold()?;
        let request = self.request(begun.values.commanded_configuration_rad, task);
        let (proposals, hash) = self.propose(&request)?;
        let id = self.execute(&request, &proposals[0], hash)?;
        let planned_s = proposals[0].motion.duration();
        // Half of it at half speed.
        let timeout = motion_timeout(2.0 * planned_s, begun.values.speed);
        let mut obeyed = Vec::new();
        for (share, order) in orders {
            let state = self.wait(timeout, "that part of the motion is done", |s| {
                s.values.trajectory_id == id && s.values.trajectory_time_s >= share * planned_s
            })?;
            let Some(order) = self.order(*order, &state)? else {
                continue;
            };
            obeyed.push(Order {
                trajectory_id: id,
                stamp_ns: mono_now_ns(),
                order,
                planned_s,
            });
        }
        let ended = self.follow(id, timeout)?;
        if ended.state == LoopState::Fault {
            bail!("the controller is in fault: {}", ended.fault);
        }
        Ok(obeyed)
    }

    /// The daemon's answer to a request that is planned and not executed.
    pub(super) fn plan(&mut self, start: Configuration, task: &Task) -> anyhow::Result<PlanAnswer> {
        Ok(self
            .client
            .plan(&self.request(start.into(), task), TIMEOUT)?)
    }

    fn request(&self, start: [f64; 6], task: &Task) -> PlanRequest {
        let ball = |b: &Ball| message::Ball {
            centre_m: b.centre.into(),
            radius_m: b.radius,
        };
        PlanRequest {
            seed: self.seed,
            candidate_count: CANDIDATES,
            deadline: Some(DEADLINE),
            balls: task.balls.iter().map(ball).collect(),
            ..PlanRequest::new(start, task.goal)
        }
    }

    fn propose(&mut self, request: &PlanRequest) -> anyhow::Result<(Vec<Proposal>, u64)> {
        let answer = self.client.plan(request, TIMEOUT)?;
        let report = answer.report();
        if report.outcome != Outcome::Ok {
            bail!("{}: {}", report.outcome, report.reason);
        }
        let proposals = answer.candidates().enumerate().map(|(index, candidate)| {
            let motion = Trajectory::new(candidate.knots.iter().map(knot).collect())?;
            let end = candidate
                .knots
                .last()
                .context("a candidate without knots")?
                .configuration_rad
                .into();
            Ok(Proposal { index, end, motion })
        });
        Ok((proposals.collect::<anyhow::Result<_>>()?, report.plan_hash))
    }

    /// Repeats the request, which gives the same plan, and has the chosen candidate executed; returns the trajectory's id. An error
    /// where somebody else has ordered a stop meanwhile.
    fn execute(
        &mut self,
        request: &PlanRequest,
        chosen: &Proposal,
        hash: u64,
    ) -> anyhow::Result<u32> {
        let request = PlanRequest {
            execute: true,
            selection: SelectionRule::Index(chosen.index),
            requested_mono_ns: Some(self.look()?.values.stamp_mono_ns),
            ..request.clone()
        };
        let answer = self.client.plan(&request, TIMEOUT)?;
        let report = answer.report();
        if report.plan_hash != hash {
            bail!("the same request gave another plan");
        }
        self.last_id = report.trajectory_id.or(self.last_id);
        report
            .trajectory_id
            .with_context(|| format!("{}: {}", report.outcome, report.reason))
    }
}

/// Mean of the measured configurations of the last [`MEASURED_OVER_NS`], rad.
pub(super) fn mean_measured(cycles: &[message::Cycle]) -> anyhow::Result<Configuration> {
    let since_ns = mono_now_ns() - MEASURED_OVER_NS;
    let recent = cycles.iter().filter(|c| c.stamp_mono_ns > since_ns);
    let measured = recent.map(|c| Configuration::from(c.measured_configuration_rad));
    let measured: Vec<Configuration> = measured.collect();
    if measured.is_empty() {
        bail!("no cycle was recorded while holding");
    }
    Ok(measured.iter().sum::<Configuration>() / measured.len() as f64)
}

fn goal_tip(robot: &Robot, goal: &Goal) -> Point {
    match goal {
        Goal::Tip { position_m, .. } => Point::from(*position_m),
        Goal::Configuration(goal) => robot.tip(&Configuration::from(*goal)),
    }
}

fn knot(knot: &message::Knot) -> Knot {
    Knot {
        time: knot.time_s,
        position: knot.configuration_rad.into(),
        velocity: knot.velocity_rad_s.into(),
        acceleration: knot.acceleration_rad_s2.into(),
    }
}

fn largest_step(cycles: &[message::Cycle]) -> f64 {
    let step = |w: &[message::Cycle]| {
        w[0].setpoint_m
            .iter()
            .zip(&w[1].setpoint_m)
            .map(|(a, b)| (b - a).abs())
            .fold(0.0, f64::max)
    };
    cycles.windows(2).map(step).fold(0.0, f64::max)
}
