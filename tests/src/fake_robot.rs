//! A robot driver of the test's own: it joins `setpoint` and `robot_state` as any driver would, and misbehaves on demand.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use pcc_model::{Configuration, Robot};
use realtime::use_fifo_priority;
use shared_types::clock::mono_now_ns;
use shared_types::codes::{MotorFault, MotorState};
use shared_types::ipc::{
    IpcError, IpcNode, IpcOptions, publisher, robot_state_service, setpoint_service, subscriber,
};
use shared_types::message::{RobotState, Setpoint};

/// The simulated robot's priority: hardware waits for nobody.
const PRIORITY: u8 = 70;
/// Time between two states.
const PERIOD: Duration = Duration::from_millis(1);

/// Time without a set-point after which the robot stands still, ns: longer than a stalled machine makes one late.
const SILENCE_NS: i64 = 200_000_000;

/// What the driver does wrong.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Misbehaviour {
    /// Nothing: it follows every set-point at once.
    #[default]
    None,
    /// It sends its last state again and again.
    RepeatsState,
    /// Its stamps are this far off the clock, ns.
    StampOffset(i64),
    /// Its reference is this far from every configuration's tendons, m, while it has not been commanded.
    OffTendonMap(f64),
    /// Its reference moves at this velocity, m/s, by its own account, while it has not been commanded.
    NeverRests(f64),
    /// Its body bends by this more than its reference, rad, while it has not been commanded.
    OffReference(f64),
    /// It takes up no set-point.
    Deaf,
}

/// What the driver is told, and what it last sent.
#[derive(Debug, Default)]
struct Shared {
    misbehaviour: Mutex<Misbehaviour>,
    sent: Mutex<Option<RobotState>>,
    quit: AtomicBool,
}

/// The driver's thread, ended when dropped.
#[derive(Debug)]
pub struct FakeRobot {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<Result<(), IpcError>>>,
}

impl FakeRobot {
    /// Starts a driver whose robot stands straight.
    #[must_use]
    pub fn start(options: &IpcOptions, robot: &Robot, misbehaviour: Misbehaviour) -> Self {
        let shared = Arc::new(Shared::default());
        *shared.misbehaviour.lock().unwrap() = misbehaviour;
        let driver = Driver {
            robot: robot.clone(),
            shared: Arc::clone(&shared),
            state: RobotState {
                robot_hash: robot.hash(),
                ..RobotState::ZEROED
            },
            set_point_ns: 0,
        };
        let options = options.clone();
        Self {
            shared,
            thread: Some(thread::spawn(move || driver.serve(&options))),
        }
    }

    /// Changes what it does wrong, from its next cycle on.
    pub fn misbehave(&self, misbehaviour: Misbehaviour) {
        *self.shared.misbehaviour.lock().unwrap() = misbehaviour;
    }

    /// The last state that it sent.
    #[must_use]
    pub fn sent(&self) -> Option<RobotState> {
        *self.shared.sent.lock().unwrap()
    }
}

impl Drop for FakeRobot {
    fn drop(&mut self) {
        self.shared.quit.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

struct Driver {
    robot: Robot,
    shared: Arc<Shared>,
    /// As it really is.
    state: RobotState,
    set_point_ns: i64,
}

impl Driver {
    fn serve(mut self, options: &IpcOptions) -> Result<(), IpcError> {
        let node = IpcNode::create(options, "fake-robot")?;
        let setpoints = subscriber(&node, &setpoint_service(&node)?)?;
        let states = publisher(&node, &robot_state_service(&node)?)?;
        // On a busy machine a driver without one goes silent; a refusal changes nothing else.
        let _ = use_fifo_priority(PRIORITY);
        self.state.state = MotorState::Idle.code();
        self.state.fault = MotorFault::None.code();
        while !self.shared.quit.load(Ordering::Relaxed) {
            let misbehaviour = *self.shared.misbehaviour.lock().unwrap();
            let mut newest = None;
            while let Ok(Some(sample)) = setpoints.receive() {
                newest = Some(*sample);
            }
            if let Some(setpoint) = newest.filter(|_| misbehaviour != Misbehaviour::Deaf) {
                self.follow(&setpoint);
            }
            self.rest_after_silence();
            self.state.sequence += 1;
            self.state.stamp_mono_ns = mono_now_ns();
            let told = self.told(misbehaviour);
            *self.shared.sent.lock().unwrap() = Some(told);
            let _ = states.send_copy(told);
            thread::sleep(PERIOD);
        }
        Ok(())
    }

    /// Stands still where it is and waits to be commanded, as a robot does that nobody commands any longer.
    fn rest_after_silence(&mut self) {
        let follows = self.state.state == MotorState::Following.code();
        if follows && mono_now_ns() - self.set_point_ns > SILENCE_NS {
            self.state.state = MotorState::AtRestAfterLoss.code();
            self.state.accepted_velocity_m_s.fill(0.0);
        }
    }

    fn follow(&mut self, setpoint: &Setpoint) {
        self.set_point_ns = mono_now_ns();
        let count = self.robot.tendons.count();
        self.state.state = MotorState::Following.code();
        self.state.accepted_sequence = setpoint.sequence;
        self.state.accepted_setpoint_m = setpoint.position_m;
        self.state.accepted_velocity_m_s = setpoint.velocity_m_s;
        self.state.measured_tendon_m = setpoint.position_m;
        let shape: Configuration = self
            .robot
            .tendons
            .configuration(&setpoint.position_m[..count]);
        self.state.measured_configuration_rad = shape.into();
    }

    /// The state as it is told.
    fn told(&self, misbehaviour: Misbehaviour) -> RobotState {
        let mut told = self.state;
        let idle = told.state == MotorState::Idle.code();
        match misbehaviour {
            Misbehaviour::None | Misbehaviour::Deaf => {}
            Misbehaviour::RepeatsState => return self.shared.sent.lock().unwrap().unwrap_or(told),
            Misbehaviour::StampOffset(offset_ns) => {
                told.stamp_mono_ns = (told.stamp_mono_ns + offset_ns).max(0);
            }
            Misbehaviour::OffTendonMap(residual_m) if idle => {
                // (1, 1, 1) on the three tendons of a section is no configuration's.
                let each_m = residual_m / 3.0_f64.sqrt();
                told.accepted_setpoint_m[..3].fill(each_m);
            }
            Misbehaviour::NeverRests(velocity_m_s) if idle => {
                told.accepted_velocity_m_s[0] = velocity_m_s;
            }
            Misbehaviour::OffReference(bending_rad) if idle => {
                told.measured_configuration_rad[0] = bending_rad;
            }
            Misbehaviour::OffTendonMap(_)
            | Misbehaviour::NeverRests(_)
            | Misbehaviour::OffReference(_) => {}
        }
        told
    }
}
