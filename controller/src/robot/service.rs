//! The simulated robot's process: one loop that drives simulated motors.

use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::Duration,
};

use robot_driver::{DriverSettings, MotorTargets, RobotConnection, RobotDriver, Shutdown};
use shared_types::{
    clock::mono_now_ns,
    codes::MotorFault,
    ipc::{IpcError, IpcOptions},
};
use tracing::{info, warn};

use super::{PoseMemory, RobotConfig, SimulatedMotors};

/// Switches from outside, turned by signals.
#[derive(Clone, Debug, Default)]
pub struct Switches {
    /// Whether the robot is to ramp to rest and end.
    pub shutdown: Arc<AtomicBool>,
    /// Whether the configured tendon's motor sticks.
    pub stuck: Arc<AtomicBool>,
    /// Whether `robot_state` stays unpublished.
    pub mute: Arc<AtomicBool>,
}

/// The robot with its driver and its memory.
struct Process<'a> {
    config: &'a RobotConfig,
    switches: &'a Switches,
    driver: RobotDriver,
    motors: SimulatedMotors,
    memory: Option<PoseMemory>,
}

/// Runs the simulated robot until it is told to shut down and its tendons rest.
///
/// # Errors
/// [`IpcError::AlreadyRunning`] where another robot lives under the same prefix and root, or what a service or a port
/// failed with.
pub fn run(
    config: &RobotConfig,
    options: &IpcOptions,
    switches: &Switches,
) -> Result<(), IpcError> {
    let settings = DriverSettings {
        period: Duration::from_nanos(config.period_ns.unsigned_abs()),
        limits: config.reference,
    };
    let connection = RobotConnection::open(options, &config.robot, &settings)?;
    let memory = if config.remembers_pose {
        open_memory(options)
    } else {
        None
    };
    let pose = memory
        .as_ref()
        .and_then(PoseMemory::recall)
        .inspect(|_| info!("standing where the robot before this one stood"))
        .unwrap_or_else(|| config.start_pose());
    let shutdown = Shutdown::asked_by(Arc::clone(&switches.shutdown));
    let process = Process {
        config,
        switches,
        motors: SimulatedMotors::new(config, mono_now_ns(), &pose),
        driver: connection.drive_until(shutdown, &pose),
        memory,
    };
    if let Some(Err(refused)) = config.realtime_priority.map(realtime::use_fifo_priority) {
        warn!("{refused}");
    }
    if let Err(refused) = realtime::reduce_wakeup_latency() {
        warn!("{refused}");
    }
    process.serve();
    Ok(())
}

fn open_memory(options: &IpcOptions) -> Option<PoseMemory> {
    let path = options.root.join(format!("{}.robot.pose", options.prefix));
    PoseMemory::open(&path)
        .inspect_err(
            |error| warn!(%error, path = %path.display(), "the pose will not survive a kill"),
        )
        .ok()
}

impl Process<'_> {
    fn serve(mut self) {
        info!(period_us = self.config.period_ns / 1_000, "robot begins");
        while let Some(targets) = self.driver.next_targets() {
            self.cycle(&targets);
        }
        if let Some(memory) = self.memory
            && let Err(error) = memory.forget()
        {
            warn!(%error, "the pose file stays");
        }
        info!("ended");
    }

    fn cycle(&mut self, targets: &MotorTargets) {
        let stuck = self.switches.stuck.load(Ordering::Relaxed);
        let stuck_tendon = stuck.then_some(self.config.stuck_tendon);
        let measured_m = self.motors.step(targets, stuck_tendon);
        if let Some(memory) = &mut self.memory {
            memory.remember(&targets.state());
        }
        if !self.switches.mute.load(Ordering::Relaxed) {
            let fault = if stuck {
                MotorFault::Injected
            } else {
                MotorFault::None
            };
            self.driver.report(&measured_m, fault);
        }
    }
}
