//! The executive decides what the loop does each cycle: a plain state machine, driven by time and inputs, that knows nothing of
//! threads.
//!
//! ```text
//! starting ──robot follows──▶ holding ──begin──▶ executing ──end──▶ holding
//!    ▲                          │                    │ stop, lost peer, late, fault
//!    └──────robot gone──────────┘                    ▼
//!    ▲                                            stopping ──at rest──▶ holding, or fault where one is latched
//!    └──────────────reset─────────────────────────────────────────────── fault
//! ```
//!
//! It never moves by itself: it starts from the robot's own reference (`accepted_setpoint_m`, never a measurement), and
//! a trajectory is followed only from where it holds. Stops go along the trajectory ([`Pace`]), as fast as the
//! acceleration limits allow. Where the robot no longer follows the set-points (it ramped to rest by itself, or is gone) the
//! machine is detached: it sends nothing and mirrors the robot's reference, so that nothing jumps when it is attached
//! again.

mod acceptance;
mod cycle;
mod ending;
mod finishing;
mod joining;
mod motion;
mod pace;
mod refusal;
mod settings;
mod supervision;
#[cfg(test)]
mod tests;
mod tracking;

pub use acceptance::{
    AcceptanceContext, BeginWindow, GuardState, check, check_start, check_still_valid,
};
pub use cycle::{CycleInput, CycleOutput, RobotSample, RobotUpdate};
pub use ending::{EndedMotion, Ending, StopOrigin};
pub use motion::{Departure, Motion};
pub use pace::{Commanded, Pace, PaceLimits};
pub use refusal::{START_TOLERANCE_RAD, TrajectoryRefusal};
pub use settings::{CONSISTENCY_M, ExecutiveSettings};
pub(crate) use settings::{ROBOT_REPLY_TIMEOUT_NS, STAMP_ALLOWANCE_NS};
pub use tracking::Tracking;

use arrayvec::ArrayVec;
use pcc_model::{Configuration, Robot, TendonMap};
use shared_types::clock::seconds;
use shared_types::codes::{CommandRefusal, LoopFault, LoopState, Waiting};
use shared_types::valid::Signature;

use crate::{TENDONS, TendonVector};

/// The set-point of all tendons.
#[derive(Clone, Copy, Debug)]
struct Tendons {
    position_m: TendonVector,
    velocity_m_s: TendonVector,
    acceleration_m_s2: TendonVector,
}

/// Offset of the set-point from the trajectory being followed; constant as long as that is followed.
#[derive(Clone, Copy, Debug)]
struct Splice {
    configuration_rad: Configuration,
    tendon_m: TendonVector,
}

/// The state machine.
#[derive(Clone)]
pub struct Executive {
    settings: ExecutiveSettings,
    robot_hash: u64,
    map: TendonMap,
    limits: PaceLimits,
    state: LoopState,
    fault: LoopFault,
    commanded: Commanded,
    tendons: Tendons,
    /// The trajectory that waits for its begin while holding, and is followed while executing and stopping.
    motion: Option<Motion>,
    /// The trajectory that the followed one leaves, until it has done so.
    left: Option<Motion>,
    /// Trajectories that are over, to be given back outside the cycle.
    finished: ArrayVec<EndedMotion, 3>,
    /// What the robot brakes for while it stops.
    stop_origin: Option<StopOrigin>,
    pace: Pace,
    splice: Splice,
    speed: f64,
    /// Whether the motion waits on its path until it is resumed.
    paused: bool,
    path_tolerance_rad: f64,
    tracking: Tracking,
    /// Whether set-points are sent to a robot that takes them.
    attached: bool,
    /// Whether the robot has followed since it was attached; false while starting or in fault.
    followed: bool,
    attached_ns: i64,
    /// The robot's newest state that was accepted.
    robot: Option<RobotSample>,
    /// Cycle time since the robot's newest accepted state: a pause of the whole machine counts as little as a late cycle.
    robot_silence_ns: i64,
    /// Why the robot states after the newest accepted one were refused, if any were.
    refused_state: Option<Waiting>,
    refused_robot_states: u32,
    guard_rounds: u64,
    /// Cycle time since the guard's last round.
    guard_silence_ns: i64,
    slack_residual_m: f64,
    /// Instant of the cycle under way, or of the last one, ns of CLOCK_MONOTONIC: the set-point is for then.
    now_ns: i64,
    /// Instant of the command, ns of CLOCK_MONOTONIC.
    commanded_ns: Option<i64>,
    late_run_ns: i64,
}

impl Executive {
    /// A machine that waits for its robot.
    #[must_use]
    pub fn new(settings: ExecutiveSettings, robot: &Robot) -> Self {
        let zero = [0.0; TENDONS];
        Self {
            settings,
            robot_hash: robot.hash(),
            map: robot.tendons.clone(),
            limits: PaceLimits::new(robot),
            state: LoopState::Starting,
            fault: LoopFault::None,
            commanded: Commanded::resting(Configuration::zeros()),
            tendons: Tendons {
                position_m: zero,
                velocity_m_s: zero,
                acceleration_m_s2: zero,
            },
            motion: None,
            left: None,
            finished: ArrayVec::new(),
            stop_origin: None,
            pace: Pace::beginning(1.0),
            splice: Splice {
                configuration_rad: Configuration::zeros(),
                tendon_m: zero,
            },
            speed: 1.0,
            paused: false,
            path_tolerance_rad: settings.hold_tolerance_rad,
            tracking: Tracking::new(settings.tracking_filter_s),
            attached: false,
            followed: false,
            attached_ns: 0,
            robot: None,
            robot_silence_ns: 0,
            refused_state: None,
            refused_robot_states: 0,
            guard_rounds: 0,
            guard_silence_ns: 0,
            slack_residual_m: 0.0,
            now_ns: 0,
            commanded_ns: None,
            late_run_ns: 0,
        }
    }

    /// State of the loop.
    #[must_use]
    pub fn state(&self) -> LoopState {
        self.state
    }

    /// Takes a trajectory to follow from its begin on, or from where it leaves the one that is followed.
    ///
    /// # Errors
    /// The trajectory back, and why it cannot start from here.
    #[expect(
        clippy::result_large_err,
        reason = "the trajectory goes back by value: boxing it would allocate in the loop"
    )]
    pub fn execute(&mut self, motion: Motion) -> Result<(), (TrajectoryRefusal, Motion)> {
        if motion.leaves.is_some() {
            return self.join(motion);
        }
        if self.motion.is_some() && self.state == LoopState::Holding {
            return Err((TrajectoryRefusal::Waiting, motion));
        }
        if let Err(reason) = check_start(&motion, self.state, &self.commanded.position) {
            return Err((reason, motion));
        }
        let first = motion.knots[0].position;
        let on_path_m = self.limits.tendons(&first);
        self.splice = Splice {
            configuration_rad: self.commanded.position - first,
            tendon_m: std::array::from_fn(|i| self.tendons.position_m[i] - on_path_m[i]),
        };
        self.motion = Some(motion);
        Ok(())
    }

    /// Gives the trajectory back that is to begin now, with the reason, if `check` refuses it.
    pub fn refuse_due(
        &mut self,
        now_ns: i64,
        check: impl FnOnce(&Motion) -> Result<(), TrajectoryRefusal>,
    ) -> Option<(TrajectoryRefusal, Motion)> {
        let waiting = self.motion.as_ref();
        let waiting = waiting.filter(|_| self.state == LoopState::Holding);
        let due = waiting.filter(|motion| motion.begin_ns <= now_ns)?;
        let reason = check(due).err()?;
        Some((reason, self.motion.take()?))
    }

    /// Gives a trajectory back that is over, the one that ended first, if there is one.
    pub fn take_finished(&mut self) -> Option<EndedMotion> {
        self.finished.pop_at(0)
    }

    /// Brakes along the trajectory and holds; forgets one that waits for its begin.
    ///
    /// # Errors
    /// [`CommandRefusal::NothingToDo`] where nothing moves or is about to.
    pub fn stop(&mut self, origin: StopOrigin) -> Result<(), CommandRefusal> {
        match self.state {
            LoopState::Executing => {
                self.give_up_join(origin);
                self.note_stop(origin);
                self.state = LoopState::Stopping;
            }
            LoopState::Stopping => {}
            LoopState::Holding if self.motion.is_some() => self.break_off(origin),
            _ => return Err(CommandRefusal::NothingToDo),
        }
        Ok(())
    }

    /// Clears the latched fault and holds with the tolerance of the settings, or waits for the robot where it is detached. Without a
    /// fault, gives up a trajectory that waits for its begin: it was requested before the reset.
    ///
    /// # Errors
    /// [`CommandRefusal::NothingToDo`] without a fault or such a trajectory, [`CommandRefusal::FaultPersists`] while it still brakes.
    pub fn reset(&mut self, ordered: Signature) -> Result<(), CommandRefusal> {
        match (self.state, self.fault) {
            (LoopState::Holding, LoopFault::None) if self.motion.is_some() => {
                self.break_off(StopOrigin::Reset(ordered));
                self.path_tolerance_rad = self.settings.hold_tolerance_rad;
                return Ok(());
            }
            (_, LoopFault::None) => return Err(CommandRefusal::NothingToDo),
            (LoopState::Fault, _) => {}
            _ => return Err(CommandRefusal::FaultPersists),
        }
        self.fault = LoopFault::None;
        // The trajectory is over, and so is what it allowed.
        self.path_tolerance_rad = self.settings.hold_tolerance_rad;
        self.tracking.restart();
        self.late_run_ns = 0;
        self.state = if self.followed {
            LoopState::Holding
        } else {
            LoopState::Starting
        };
        Ok(())
    }

    /// Follows trajectories at `speed` (0..=1) times their own rate, reached by a ramp within the limits.
    ///
    /// # Errors
    /// [`CommandRefusal::InvalidSpeed`] outside 0..=1.
    pub fn set_speed(&mut self, speed: f64) -> Result<(), CommandRefusal> {
        if !(0.0..=1.0).contains(&speed) {
            return Err(CommandRefusal::InvalidSpeed);
        }
        self.speed = speed;
        Ok(())
    }

    /// Brakes along the trajectory and stays on it, until [`Executive::resume`].
    ///
    /// # Errors
    /// [`CommandRefusal::NothingToDo`] where nothing is executed, or it waits already.
    pub fn pause(&mut self) -> Result<(), CommandRefusal> {
        self.set_paused(true)
    }

    /// Goes on after a pause.
    ///
    /// # Errors
    /// [`CommandRefusal::NothingToDo`] where nothing waits.
    pub fn resume(&mut self) -> Result<(), CommandRefusal> {
        self.set_paused(false)
    }

    fn set_paused(&mut self, paused: bool) -> Result<(), CommandRefusal> {
        if self.state != LoopState::Executing || self.paused == paused {
            return Err(CommandRefusal::NothingToDo);
        }
        self.paused = paused;
        Ok(())
    }

    /// Begins a cycle with the robot's state: call it once before each [`Executive::step`], and before motions, orders and stops of the cycle.
    /// What the robot has ended by itself is told as that, and not as what was ordered later.
    pub fn hear_robot(&mut self, now_ns: i64, update: RobotUpdate<'_>) {
        self.now_ns = now_ns;
        self.supervise_robot(update);
    }

    /// Ends the cycle that [`Executive::hear_robot`] began with the set-point for now.
    pub fn step(&mut self, input: &CycleInput) -> CycleOutput {
        // Until the machine moves on, the command and its time are the last cycle's.
        let late = self.supervise(input);
        let elapsed_ns = self.elapsed_ns();
        self.commanded_ns = Some(self.now_ns);
        if self.attached {
            self.move_on(elapsed_ns);
        } else {
            self.mirror_robot();
        }
        self.output(late)
    }

    /// Time since the last cycle, ns.
    fn elapsed_ns(&self) -> i64 {
        self.now_ns - self.commanded_ns.unwrap_or(self.now_ns)
    }

    fn move_on(&mut self, elapsed_ns: i64) {
        // A late cycle samples by absolute time, but never further on than `step_cap`: the path time then lags.
        let mut step_ns = elapsed_ns.min(self.settings.step_cap_ns);
        if self.state == LoopState::Holding {
            let Some(motion) = &self.motion else {
                return;
            };
            let begun_ns = self.now_ns - motion.begin_ns;
            if begun_ns < 0 {
                return;
            }
            self.path_tolerance_rad = motion.path_tolerance_rad;
            self.state = LoopState::Executing;
            self.stop_origin = None;
            self.pace = Pace::beginning(self.speed);
            step_ns = step_ns.min(begun_ns);
        }
        if self.is_moving() {
            self.follow(seconds(step_ns));
            self.check_setpoint();
        }
    }

    /// Detaches from the robot, which then ramps to rest, where the set-point is beyond the limits: such a one is never sent.
    fn check_setpoint(&mut self) {
        let tendons = &self.tendons;
        let finite = tendons
            .position_m
            .iter()
            .all(|position| position.is_finite());
        if !finite
            || !self
                .limits
                .allow(&tendons.velocity_m_s, &tendons.acceleration_m_s2)
        {
            self.detach(Some(LoopFault::InvalidSetpoint));
            self.mirror_robot();
        }
    }

    fn is_moving(&self) -> bool {
        matches!(self.state, LoopState::Executing | LoopState::Stopping)
    }

    fn is_robot_lost(&self) -> bool {
        self.robot_silence_ns > self.settings.robot_lost_ns
    }

    fn follow(&mut self, step_s: f64) {
        let stopping = self.state == LoopState::Stopping;
        let target = if stopping || self.paused {
            0.0
        } else {
            self.speed
        };
        let Some(motion) = &self.motion else {
            return self.rest();
        };
        let knots = &motion.knots;
        let mut commanded = self.pace.advance(knots, &self.limits, target, step_s);
        let on_path_m = self.limits.tendons(&commanded.position);
        self.tendons = Tendons {
            position_m: std::array::from_fn(|i| on_path_m[i] + self.splice.tendon_m[i]),
            velocity_m_s: self.limits.tendons(&commanded.velocity),
            acceleration_m_s2: self.limits.tendons(&commanded.acceleration),
        };
        commanded.position += self.splice.configuration_rad;
        self.commanded = commanded;
        let ended = self.pace.time_s >= motion.duration_s();
        self.pace.time_s = self.pace.time_s.min(motion.duration_s());
        self.finish_join();
        if ended || (stopping && self.pace.rate == 0.0) {
            self.rest();
        }
    }

    /// Ends the motion and holds where the robot is commanded to be, or stays in fault.
    fn rest(&mut self) {
        self.end_at_rest();
        self.paused = false;
        self.commanded = Commanded::resting(self.commanded.position);
        self.tendons.velocity_m_s = [0.0; TENDONS];
        self.tendons.acceleration_m_s2 = [0.0; TENDONS];
        self.state = match self.fault {
            LoopFault::None => LoopState::Holding,
            _ => LoopState::Fault,
        };
    }

    fn mirror_robot(&mut self) {
        let Some(robot) = self.robot.as_ref().filter(|_| !self.is_robot_lost()) else {
            return;
        };
        let count = self.map.count();
        self.tendons = Tendons {
            position_m: robot.accepted_m,
            velocity_m_s: robot.accepted_velocity_m_s,
            acceleration_m_s2: [0.0; TENDONS],
        };
        self.commanded = Commanded {
            position: self.map.configuration(&robot.accepted_m[..count]),
            velocity: self
                .map
                .configuration(&robot.accepted_velocity_m_s[..count]),
            acceleration: Configuration::zeros(),
        };
    }

    fn output(&self, late: bool) -> CycleOutput {
        let robot = self.robot.as_ref();
        let followed = self.followed_motion();
        CycleOutput {
            stamp_ns: self.now_ns,
            send: self.attached,
            state: self.state,
            fault: self.fault,
            waiting: self.waiting(),
            robot_hash: robot.map_or(0, |robot| robot.robot_hash),
            accepted_residual_m: robot.map_or(0.0, |robot| self.accepted_residual_m(robot)),
            refused_robot_states: self.refused_robot_states,
            trajectory_id: followed.trajectory_id,
            pending_trajectory_id: followed.pending_trajectory_id,
            commanded: self.commanded,
            tendon_m: self.tendons.position_m,
            tendon_velocity_m_s: self.tendons.velocity_m_s,
            tendon_acceleration_m_s2: self.tendons.acceleration_m_s2,
            measured_m: robot.map_or([0.0; TENDONS], |robot| robot.measured_m),
            measured_rad: robot.map_or_else(Configuration::zeros, |robot| robot.measured_rad),
            tracking_error_rad: self.tracking.norm_rad(),
            path_tolerance_rad: self.path_tolerance_rad,
            slack_residual_m: self.slack_residual_m,
            splice_error_m: self
                .splice
                .tendon_m
                .iter()
                .map(|x| x * x)
                .sum::<f64>()
                .sqrt(),
            path_time_s: followed.path_time_s,
            rate: self.pace.rate,
            speed: self.speed,
            paused: self.paused,
            late,
        }
    }
}
