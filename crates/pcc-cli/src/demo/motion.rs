//! One motion of the demonstration: ask, choose, execute, wait, measure.

use super::recording::Recording;
use super::standing::{PATIENCE, Slowed, fresh_state, is_under_way};
use crate::known_orders::KnownOrders;
use crate::order::STANDS_STILL;
use anyhow::{Context, bail};
use client::{Client, ControllerView, PlanAnswer};
use collision::{Ball, Scene, minimum_clearance};
use pcc_model::{Configuration, Point, Robot};
use serde::Serialize;
use shared_types::clock::mono_now_ns;
use shared_types::codes::{CommandRefusal, LoopFault, LoopState, Outcome, Refusal};
use shared_types::message;
use shared_types::valid::{Command, ControllerState, Goal, PlanRequest, SelectionRule};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use trajectory::{Knot, Trajectory};

/// Candidates of every request, as in the paper.
const CANDIDATES: usize = 10;
/// The demonstration is not about latency.
const DEADLINE: Duration = Duration::from_millis(500);
/// A motion that ends farther from its goal configuration was stopped on the way, rad.
const SAME_CONFIGURATION_RAD: f64 = 1e-5;
/// Longest time that a motion at a low speed is waited for, seconds.
const LONGEST_MOTION_S: f64 = 86_400.0;
/// How long the robot holds after a motion; its last part is averaged for the measured tip.
const HOLD: Duration = Duration::from_millis(1000);
const MEASURED_OVER_NS: i64 = 300_000_000;

/// What is known of a finished motion.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Report {
    pub(super) experiment: u32,
    pub(super) name: String,
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
    /// At the end of the trajectory.
    Done(Report),
    /// On the way: the controller stopped the robot along its path.
    Stopped {
        trajectory_id: u32,
        fault: LoopFault,
    },
}

/// An order that the controller obeyed on the way of a motion.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Order {
    pub(super) trajectory_id: u32,
    pub(super) stamp_ns: i64,
    /// `stop`, `speed` or `reset`.
    pub(super) order: &'static str,
    /// How long the motion would have taken without orders.
    pub(super) planned_s: f64,
}

/// What the demonstration has the controller do on the way of a motion.
#[derive(Clone, Copy)]
pub(super) enum OnTheWay {
    /// Half of the speed found.
    Slower,
    /// The speed found.
    AsFound,
    Stop,
}

/// One candidate, in the robot's own units.
pub(super) struct Proposal {
    pub(super) index: usize,
    pub(super) end: Configuration,
    motion: Trajectory,
}

/// Where to, and what is in the way.
pub(super) struct Task<'a> {
    pub(super) experiment: u32,
    pub(super) name: &'a str,
    pub(super) goal: Goal,
    pub(super) balls: &'a [Ball],
}

/// The processes that carry a motion out.
pub(super) struct Stage<'a> {
    pub(super) robot: &'a Robot,
    pub(super) client: Client,
    pub(super) controller: ControllerView,
    /// The demonstration is to end now.
    pub(super) interrupted: Arc<AtomicBool>,
    pub(super) seed: u64,
    /// Noted before the demonstration waits for anything.
    pub(super) known_orders: KnownOrders,
    /// The motion that was executed last.
    pub(super) last_id: Option<u32>,
    /// Where the demonstration has ordered a speed that it has not given back yet.
    pub(super) slowed: Option<Slowed>,
}

impl Stage<'_> {
    /// Waits until the controller holds.
    pub(super) fn begin(&mut self) -> anyhow::Result<()> {
        let held = self.hold()?.values;
        if held.speed < 1.0 {
            let speed = held.speed;
            say!("the controller follows motions at speed {speed} of their own rate");
        }
        Ok(())
    }

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
        let ended = self.follow(id, patience(chosen.motion.duration(), begun.values.speed))?;
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

    /// Plans from where the controller holds, executes the first candidate, and gives each order when that share of the motion is
    /// done; returns what was obeyed once the robot rests.
    pub(super) fn order_about(
        &mut self,
        task: &Task,
        orders: &[(f64, OnTheWay)],
    ) -> anyhow::Result<Vec<Order>> {
        let begun = self.hold()?;
        let request = self.request(begun.values.commanded_configuration_rad, task);
        let (proposals, hash) = self.propose(&request)?;
        let id = self.execute(&request, &proposals[0], hash)?;
        let planned_s = proposals[0].motion.duration();
        // Half of it at half speed.
        let patience = patience(2.0 * planned_s, begun.values.speed);
        let mut obeyed = Vec::new();
        for (share, wish) in orders {
            let state = self.wait(patience, "that part of the motion is done", |s| {
                s.values.trajectory_id == id && s.values.trajectory_time_s >= share * planned_s
            })?;
            let Some(order) = self.order(*wish, &state)? else {
                continue;
            };
            obeyed.push(Order {
                trajectory_id: id,
                stamp_ns: mono_now_ns(),
                order,
                planned_s,
            });
        }
        let ended = self.follow(id, patience)?;
        if ended.state == LoopState::Fault {
            bail!("the controller is in fault: {}", ended.fault);
        }
        Ok(obeyed)
    }

    /// Gives an order, and returns its name; none where the speed is somebody else's by now, which stays.
    fn order(
        &mut self,
        wish: OnTheWay,
        state: &ControllerState,
    ) -> anyhow::Result<Option<&'static str>> {
        match wish {
            OnTheWay::Slower => {
                // Noted before it is ordered: an order without a reply may be obeyed.
                let slowed = *self.slowed.insert(Slowed::from(&state.values));
                self.obeyed(Command::SetSpeed(slowed.ordered))?;
                Ok(Some("speed"))
            }
            OnTheWay::AsFound => {
                let Some(slowed) = self.slowed.filter(|slowed| slowed.stands(&state.values)) else {
                    let speed = state.values.speed;
                    say!("  somebody else has ordered speed {speed} meanwhile; it stays");
                    self.slowed = None;
                    return Ok(None);
                };
                self.obeyed(Command::SetSpeed(slowed.found))?;
                self.slowed = None;
                Ok(Some("speed"))
            }
            OnTheWay::Stop => {
                self.obeyed(Command::Stop)?;
                self.note_own_order();
                Ok(Some("stop"))
            }
        }
    }

    /// Gives an order that must be obeyed.
    fn obeyed(&mut self, command: Command) -> anyhow::Result<()> {
        let reply = self.controller.command(command, PATIENCE)?;
        if !reply.accepted {
            bail!("the controller does not obey: {}", reply.reason);
        }
        Ok(())
    }

    /// The controller has just answered a stop or a reset of the demonstration's own.
    fn note_own_order(&mut self) {
        self.known_orders.add_own(mono_now_ns());
    }

    /// What the daemon answers to a request that is only planned.
    pub(super) fn ask(&mut self, start: Configuration, task: &Task) -> anyhow::Result<PlanAnswer> {
        Ok(self
            .client
            .plan(&self.request(start.into(), task), PATIENCE)?)
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
        let answer = self.client.plan(request, PATIENCE)?;
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

    /// Repeats the request, which gives the same plan, and has the chosen candidate executed. What was stopped while it was planned is
    /// not asked for.
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
        let answer = self.client.plan(&request, PATIENCE)?;
        let report = answer.report();
        if report.plan_hash != hash {
            bail!("the same request gave another plan");
        }
        self.last_id = report.trajectory_id.or(self.last_id);
        report
            .trajectory_id
            .with_context(|| format!("{}: {}", report.outcome, report.reason))
    }

    /// Waits until the controller holds, and would follow a motion.
    pub(super) fn hold(&mut self) -> anyhow::Result<ControllerState> {
        let held = self.wait(PATIENCE, "the controller holds", |s| {
            s.state == LoopState::Holding
        })?;
        if held.values.speed <= 0.0 {
            bail!("{STANDS_STILL}");
        }
        Ok(held)
    }

    /// Waits until a trajectory is taken, and so long until the robot rests again.
    fn follow(&mut self, id: u32, patience: Duration) -> anyhow::Result<ControllerState> {
        let taken = self.wait(PATIENCE, "the trajectory is taken", |s| {
            s.values.trajectory_id == id || s.values.refused_trajectory_id == id
        })?;
        if taken.values.refused_trajectory_id == id && taken.refusal != Refusal::None {
            bail!("the controller refused the trajectory: {}", taken.refusal);
        }
        self.wait(patience, "the motion ends", |s| {
            matches!(s.state, LoopState::Holding | LoopState::Fault)
        })
    }

    /// Stops what moves, if something does.
    pub(super) fn stop(&mut self) {
        match self.controller.command(Command::Stop, PATIENCE) {
            Ok(reply) if reply.accepted || reply.reason == CommandRefusal::NothingToDo => {}
            Ok(reply) => say!(
                "the robot may move on: the stop was answered with `{}`",
                reply.reason
            ),
            Err(error) => say!("the robot may move on: {error}"),
        }
    }

    /// Stops the demonstration's own last motion, if that is under way, or may still begin: another one is somebody else's.
    pub(super) fn stop_own(&mut self) {
        let Some(id) = self.last_id else {
            return;
        };
        let known = &self.known_orders;
        let is_own = fresh_state(&mut self.controller).is_none_or(|state| {
            known.is_same_controller(&state.values) && is_under_way(&state, id)
        });
        if is_own {
            self.stop();
        }
    }

    /// Gives the speed back that the demonstration found, where it has not yet.
    pub(super) fn restore_speed(&mut self) {
        if let Some(slowed) = self.slowed.take() {
            slowed.give_back(&mut self.controller);
        }
    }

    /// Clears the controller's fault, unless somebody else has ordered something meanwhile.
    pub(super) fn reset(&mut self) -> anyhow::Result<()> {
        self.look()?;
        let reply = self.controller.command(Command::ResetFault, PATIENCE)?;
        if !reply.accepted {
            bail!("the controller does not reset: {}", reply.reason);
        }
        self.note_own_order();
        Ok(())
    }

    /// Waits for a fresh state, and so for the orders of others that it tells of.
    fn look(&mut self) -> anyhow::Result<ControllerState> {
        self.wait(PATIENCE, "the controller says what it does", |_| true)
    }

    /// Waits for a fresh state of that kind; a stop or a reset of somebody else ends the wait.
    fn wait(
        &mut self,
        patience: Duration,
        what: &str,
        until: impl Fn(&ControllerState) -> bool,
    ) -> anyhow::Result<ControllerState> {
        let (asked, end) = (mono_now_ns(), Instant::now() + patience);
        while Instant::now() < end {
            if self.interrupted.load(Ordering::Relaxed) {
                bail!("interrupted");
            }
            if let Some(state) = self.controller.latest_state()?
                && state.values.stamp_mono_ns >= asked
            {
                let checked = self.known_orders.check(&state.values);
                checked.context("the demonstration ends here, and resets nothing")?;
                if until(&state) {
                    return Ok(state);
                }
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        bail!("waited {patience:?} in vain until {what}")
    }
}

/// How long the end of a motion is waited for that lasts so long at its own rate.
fn patience(duration_s: f64, speed: f64) -> Duration {
    PATIENCE + Duration::from_secs_f64((duration_s / speed).min(LONGEST_MOTION_S))
}

/// Mean of the measured configurations of the last [`MEASURED_OVER_NS`], rad.
fn mean_measured(cycles: &[message::Cycle]) -> anyhow::Result<Configuration> {
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
        Goal::Configuration(shape) => robot.tip(&Configuration::from(*shape)),
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slow_motion_is_waited_for_longer() {
        assert_eq!(patience(4.0, 1.0), PATIENCE + Duration::from_secs(4));
        assert_eq!(patience(4.0, 0.5), PATIENCE + Duration::from_secs(8));
        for speed in [1e-300, f64::MIN_POSITIVE] {
            assert!(patience(4.0, speed) <= PATIENCE + Duration::from_secs(86_400));
        }
    }
}
