//! The controller in a program that has a loop and motors of its own: everything but the set-points' way to the motors.

use std::sync::{Arc, atomic::Ordering};
use std::time::Duration;

use robot_driver::{
    DrivenRobot, MotorTargets, ReferenceLimits, Shutdown, TendonState, TendonVector, no_handler,
};
use shared_types::{
    codes::{LoopState, MotorFault},
    ipc::{IpcError, IpcOptions},
    message::{RobotState, Setpoint},
};

use signal_hook::consts::SIGUSR1;
use signal_hook::{SigId, flag, low_level};

use super::{
    config::ControllerConfig,
    guard::Signals,
    loop_services::LoopServices,
    loop_step::{LoopStep, RobotSide},
    periodic_deadlines::PeriodicDeadlines,
};
use crate::executive::Commanded;

/// The controller's name in errors.
const SERVICE: &str = "controller";

/// Follows the planner's trajectories in the controller's place, for a program that moves the motors itself: one call of
/// [`Self::next_cycle`] and one of [`Self::report`] a cycle.
///
/// It joins and leaves trajectories, stops along the path, and obeys commands as the controller does: it is the controller's loop, and its guard
/// and relay are threads of this process, with the priority that the configuration names for the guard. **Drop it only at rest** (after [`Self::shut_down`], once there is no next cycle), for nothing brings
/// the motors to rest afterwards. It stays in its thread.
pub struct Follower {
    step: LoopStep,
    motors: Motors,
    deadlines: PeriodicDeadlines,
    shutdown: Shutdown,
    services: LoopServices,
    _stop_signal: StopSignal,
}

/// The handler of SIGUSR1, while this lives.
struct StopSignal(SigId);

impl Drop for StopSignal {
    fn drop(&mut self) {
        low_level::unregister(self.0);
    }
}

/// One cycle of a follower: what the motors are to do, and the configuration that is commanded.
#[derive(Clone, Copy, Debug)]
pub struct FollowedCycle {
    /// What the motors are to do.
    pub targets: MotorTargets,
    /// The configuration of the set-point with its derivatives, rad, rad/s, rad/s².
    pub commanded: Commanded,
    /// State of the loop.
    pub state: LoopState,
    /// The trajectory being followed, 0 for none.
    pub trajectory_id: u32,
}

/// The motors, as the loop knows them.
struct Motors {
    driven: DrivenRobot,
    /// What was reported and is not taken yet.
    state: Option<RobotState>,
    setpoint: Option<Setpoint>,
}

impl RobotSide for Motors {
    fn newest_state(&mut self) -> Option<RobotState> {
        self.state.take()
    }

    fn send(&mut self, setpoint: &Setpoint) {
        self.setpoint = Some(*setpoint);
    }
}

impl Follower {
    /// Takes the controller's place under a prefix and root, with motors in this state: where it moves, they first ramp to rest. Priority and
    /// processor of the calling thread, and what of the process's memory is locked, stay as they are. From then on SIGUSR1 stops the robot
    /// along its path, as `pcc stop` wants it where the loop is held up.
    ///
    /// # Errors
    /// [`IpcError::AlreadyRunning`] where another controller lives there, or what a service or a port failed with.
    pub fn open(
        config: ControllerConfig,
        options: &IpcOptions,
        motors: &TendonState,
    ) -> Result<Self, IpcError> {
        let (config, signals) = (Arc::new(config), Signals::default());
        let shutdown = Shutdown::asked_by(Arc::clone(&signals.shutdown));
        let handler = flag::register(SIGUSR1, Arc::clone(&signals.stop))
            .map_err(|error| no_handler(SERVICE, "SIGUSR1", &error))?;
        let stop_signal = StopSignal(handler);
        let (services, link) = LoopServices::start(&config, options, signals)?;
        robot_driver::claim_shared_memory(options)?;
        let period = Duration::from_nanos(config.executive.period_ns.unsigned_abs());
        let limits = ReferenceLimits::of(&config.robot, period);
        Ok(Self {
            step: LoopStep::new(&config, link),
            motors: Motors {
                driven: DrivenRobot::new(&config.robot, limits, motors),
                state: None,
                setpoint: None,
            },
            deadlines: PeriodicDeadlines::from_now(config.executive.period_ns),
            shutdown,
            services,
            _stop_signal: stop_signal,
        })
    }

    /// Waits for the next cycle and says what the motors are to do in it; none once it was shut down and they stand still: motors in fault
    /// ramp to rest first.
    pub fn next_cycle(&mut self) -> Option<FollowedCycle> {
        if self.services.shared().is_quitting() && self.motors.driven.is_at_rest() {
            return None;
        }
        let deadline_ns = self.deadlines.wait();
        let output = self.step.cycle(deadline_ns, &mut self.motors);
        let setpoint = self.motors.setpoint.take();
        // At the set-point's own instant: a stall since then would let the velocity jump between targets' stamps.
        let now_ns = output.stamp_ns;
        Some(FollowedCycle {
            targets: self.motors.driven.next_targets(now_ns, setpoint.as_ref()),
            commanded: output.commanded,
            state: output.state,
            trajectory_id: output.trajectory_id,
        })
    }

    /// Says what the motors did in this cycle: tendon lengths relative to straight as measured, m (those beyond the robot's tendons are 0), and
    /// what is wrong with them. Without a report for `robot_lost_ms` of the configuration the robot counts as lost.
    pub fn report(&mut self, measured_tendon_m: &TendonVector, fault: MotorFault) {
        self.motors.state = Some(self.motors.driven.state(measured_tendon_m, fault));
    }

    /// Stops the robot along its path; go on with cycles until there is none.
    pub fn shut_down(&self) {
        self.shutdown.ask();
    }

    /// Has Ctrl-C and SIGTERM do what [`Self::shut_down`] does, in place of ending the process in motion, until this is dropped.
    ///
    /// # Errors
    /// [`IpcError::Failed`] where the system refuses a handler.
    pub fn shut_down_at_signals(&mut self) -> Result<(), IpcError> {
        self.shutdown.ask_at_signals(SERVICE)
    }
}

impl Drop for Follower {
    fn drop(&mut self) {
        let ended = &self.services.shared().loop_has_ended;
        ended.store(true, Ordering::Release);
    }
}
