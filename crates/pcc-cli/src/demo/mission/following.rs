//! The fourth experiment: the daemon keeps the robot on its way to a target that moves, while a ball crosses that.

use std::sync::atomic::Ordering;
use std::thread::sleep;
use std::time::{Duration, Instant};

use anyhow::{Context, bail, ensure};
use collision::{Ball, Scene};
use pcc_model::{Configuration, Point};
use shared_types::clock::{mono_now_ns, seconds};
use shared_types::codes::{GoalState, LoopFault};
use shared_types::message::Cycle;
use shared_types::valid::{Goal, GoalStatus};

use super::{ATTEMPTS, Mission, STALL_FAULTS, end_of_demonstration};
use crate::demo::controller_state::fresh_state;
use crate::demo::followed::Followed;
use crate::demo::kept_goal::KeptGoal;
use crate::demo::motion::{HOLD, mean_measured};
use crate::demo::moving::{Moving, SEEN_S, TURN_S};
use crate::demo::session::motion_timeout;
use crate::foreign_orders::Overruled;

/// Time between two messages on where the target is.
const PERIOD: Duration = Duration::from_millis(10);
/// Of so many of these one is followed by a message on where the ball is.
const SCENE_EVERY: u64 = 2;
/// Longest time in which the target is reached at full speed where it rests, s.
const REACHED_WITHIN_S: f64 = 10.0;

/// When the target was followed, nanoseconds of `CLOCK_MONOTONIC`.
#[derive(Clone, Copy)]
struct Times {
    /// The goal is given where the target will begin to move.
    given_ns: i64,
    /// The target begins to move.
    moves_ns: i64,
    /// The robot has reached the target, which rests.
    reached_ns: i64,
}

/// How an attempt ended.
enum Attempt {
    Reached(Times),
    /// A stalled machine has stopped the robot on this trajectory.
    Stalled(u32),
}

impl Mission<'_> {
    /// Has the target followed, again where the machine stalls; an error where it is not reached, the robot meets the ball, or results of
    /// motions are missing.
    pub(super) fn follow_target(&mut self) -> anyhow::Result<()> {
        let moving = Moving::new(self.length);
        self.show(&[])?;
        say!(
            "  the target moves on a circle for {TURN_S} s; from {} s to {} s of these a ball crosses its way",
            SEEN_S.start,
            SEEN_S.end
        );
        for _ in 0..ATTEMPTS {
            let mut goal = KeptGoal::connect(&self.options)?;
            let attempt = self.attempt(&moving, &mut goal);
            let withdrawn = goal.withdraw();
            goal.print_states();
            match attempt? {
                Attempt::Reached(times) => {
                    withdrawn?;
                    return self.judge(&moving, &goal, times);
                }
                Attempt::Stalled(trajectory_id) => {
                    goal.results().print();
                    say!("  the machine stalled; reset, and followed again");
                    self.interrupted.push(trajectory_id);
                    self.show(&[])?;
                    self.session.reset()?;
                }
            }
        }
        bail!("the target that moves: stopped on the way {ATTEMPTS} times");
    }

    /// Goes to where the target is, follows it, and waits until it is reached where it rests.
    fn attempt(&mut self, moving: &Moving, goal: &mut KeptGoal) -> anyhow::Result<Attempt> {
        let given_ns = mono_now_ns();
        goal.give(tip(moving, 0.0))?;
        if let Some(id) = self.wait_until_reached(goal)? {
            return Ok(Attempt::Stalled(id));
        }
        let moves_ns = mono_now_ns();
        if let Some(id) = self.move_target(moving, goal, moves_ns)? {
            return Ok(Attempt::Stalled(id));
        }
        goal.move_to(tip(moving, TURN_S), [0.0; 3])?;
        if let Some(id) = self.wait_until_reached(goal)? {
            return Ok(Attempt::Stalled(id));
        }
        Ok(Attempt::Reached(Times {
            given_ns,
            moves_ns,
            reached_ns: mono_now_ns(),
        }))
    }

    /// Moves target and ball until the target rests; the trajectory on which a stalled machine has stopped the robot, if it has.
    fn move_target(
        &mut self,
        moving: &Moving,
        goal: &mut KeptGoal,
        begun_ns: i64,
    ) -> anyhow::Result<Option<u32>> {
        let begun = Instant::now();
        let mut has_ball = false;
        for step in 1_u64.. {
            let now_ns = mono_now_ns();
            let time_s = seconds(now_ns - begun_ns);
            if time_s >= TURN_S {
                break;
            }
            goal.move_to(tip(moving, time_s), moving.target_velocity_m_s(time_s))?;
            if step.is_multiple_of(SCENE_EVERY) {
                self.move_ball(moving, now_ns, time_s, &mut has_ball)?;
            }
            let status = goal.look()?;
            if let Some(id) = self.check(status.as_ref().or(goal.latest()))? {
                return Ok(Some(id));
            }
            let next = PERIOD * u32::try_from(step)?;
            sleep(next.saturating_sub(begun.elapsed()));
        }
        Ok(None)
    }

    fn move_ball(
        &mut self,
        moving: &Moving,
        now_ns: i64,
        time_s: f64,
        has_ball: &mut bool,
    ) -> anyhow::Result<()> {
        match moving.ball(time_s) {
            Some(ball) => {
                self.obstacles.move_to(now_ns, &[ball])?;
                if !*has_ball {
                    self.recording.note_scene(now_ns, &[ball]);
                }
                *has_ball = true;
            }
            None if *has_ball => {
                self.show(&[])?;
                *has_ball = false;
            }
            None => {}
        }
        Ok(())
    }

    /// Waits until the goal is reached as it was sent last; the trajectory on which a stalled machine has stopped the robot, if it has.
    fn wait_until_reached(&mut self, goal: &mut KeptGoal) -> anyhow::Result<Option<u32>> {
        let speed = fresh_state(&mut self.session.controller)
            .context("the controller is silent")?
            .values
            .speed;
        let timeout = motion_timeout(REACHED_WITHIN_S, speed);
        let begun = Instant::now();
        while begun.elapsed() < timeout {
            let status = goal.look()?;
            if let Some(id) = self.check(status.as_ref())? {
                return Ok(Some(id));
            }
            if status.is_some_and(|status| status.state == GoalState::Reached) {
                return Ok(None);
            }
            sleep(PERIOD);
        }
        let status = goal.latest().map(ToString::to_string);
        let status = status.unwrap_or_else(|| "the daemon says nothing of the goal".into());
        bail!("the target was not reached within {timeout:?}: {status}")
    }

    /// An error where the demonstration is interrupted, or where the goal was ended by anything but a stalled machine; the trajectory
    /// that was executed where it was ended by that.
    fn check(&mut self, status: Option<&GoalStatus>) -> anyhow::Result<Option<u32>> {
        if self.session.interrupted.load(Ordering::Relaxed) {
            bail!("interrupted");
        }
        let Some(status) = status else {
            return Ok(None);
        };
        let id = status.values.trajectory_id;
        self.session.last_id = Some(id).filter(|id| *id != 0).or(self.session.last_id);
        let text = status.to_string();
        match status.state {
            GoalState::Ended => {}
            GoalState::Refused => bail!("the goal is refused: {text}"),
            _ => return Ok(None),
        }
        let fault = fresh_state(&mut self.session.controller).map(|state| state.fault);
        match fault {
            Some(fault) if STALL_FAULTS.contains(&fault) => {
                // The daemon's own stops on the way are none of somebody else.
                self.session.foreign_orders.ignore_own(mono_now_ns());
                Ok(Some(id))
            }
            Some(fault) if fault != LoopFault::None => {
                bail!("{}", end_of_demonstration(fault))
            }
            _ => Err(Overruled::GoalEnded { reason: text }.into()),
        }
    }

    /// Measures what was done, prints it, and checks it.
    fn judge(&mut self, moving: &Moving, goal: &KeptGoal, times: Times) -> anyhow::Result<()> {
        sleep(HOLD);
        let cycles = self.recording.since(times.given_ns)?;
        let last = cycles.last().context("no cycle was recorded")?;
        let robot = self.session.robot;
        let commanded = |cycle: &Cycle| Configuration::from(cycle.commanded_configuration_rad);
        let status = goal
            .latest()
            .context("the daemon said nothing of the goal")?;
        let results = goal.results();
        let followed = Followed {
            begin_ns: times.given_ns,
            end_ns: last.stamp_mono_ns,
            requested_tip_m: moving.target_m(TURN_S),
            reached_tip_m: robot.tip(&commanded(last)).into(),
            measured_tip_m: robot.tip(&mean_measured(&cycles)?).into(),
            mean_tip_error_m: self.mean_tip_error_m(moving, &cycles, times.moves_ns),
            minimum_clearance_m: self.minimum_clearance_m(moving, &cycles, times.moves_ns)?,
            plans: status.values.plan_count,
            motions: status.values.motion_count,
            outcomes: results.counts(),
            missing_results: results.missing(),
        };
        let lasted_s = seconds(times.reached_ns - times.given_ns);
        followed.print(lasted_s);
        results.print();
        ensure!(
            goal.has_ended(status.values.trajectory_id),
            "the result of trajectory {}, the last one, is missing",
            status.values.trajectory_id
        );
        followed.check(self.length)?;
        self.followed = Some(followed);
        Ok(())
    }

    fn mean_tip_error_m(&self, moving: &Moving, cycles: &[Cycle], moves_ns: i64) -> f64 {
        let errors = cycles.iter().filter_map(|cycle| {
            let time_s = seconds(cycle.stamp_mono_ns - moves_ns);
            let tip = self
                .session
                .robot
                .tip(&Configuration::from(cycle.commanded_configuration_rad));
            (0.0..TURN_S)
                .contains(&time_s)
                .then(|| moving.error_m(time_s, &tip))
        });
        let (sum, count) = errors.fold((0.0, 0), |(sum, count), error| (sum + error, count + 1));
        sum / f64::from(count.max(1))
    }

    fn minimum_clearance_m(
        &self,
        moving: &Moving,
        cycles: &[Cycle],
        moves_ns: i64,
    ) -> anyhow::Result<f64> {
        let mut least = f64::INFINITY;
        for cycle in cycles {
            let Some(ball) = moving.ball(seconds(cycle.stamp_mono_ns - moves_ns)) else {
                continue;
            };
            let scene = Scene::new(vec![Ball {
                centre: Point::from(ball.centre_m),
                radius: ball.radius_m,
            }])?;
            let configuration = Configuration::from(cycle.commanded_configuration_rad);
            least = least.min(scene.clearance_at(self.session.robot, &configuration));
        }
        Ok(least)
    }
}

fn tip(moving: &Moving, time_s: f64) -> Goal {
    Goal::tip(moving.target_m(time_s))
}
