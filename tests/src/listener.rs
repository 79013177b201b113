//! Everything that the robot and the controller publish, kept.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use realtime::use_fifo_priority;
use shared_types::codes::{MotionStart, ProcessKind};
use shared_types::ipc::{
    CycleSubscriber, IpcError, IpcNode, IpcOptions, Subscriber, controller_state_service,
    cycle_service, heartbeat_service, motion_result_service, observer_subscriber,
    plan_record_service, robot_state_service, setpoint_service, subscriber, trajectory_service,
};
use shared_types::message::{
    ControllerState, Cycle, Heartbeat, MotionResult, PlanRecord, RobotState, Setpoint,
    TrajectoryMessage,
};

use crate::knots::Knot;
use crate::priority::OF_A_WATCH;

/// What was heard, in order of arrival.
#[derive(Clone, Debug, Default)]
pub struct Heard {
    /// The set-points that the controller sends to the robot, about 1 kHz in motion and while it holds.
    pub setpoints: Vec<Setpoint>,
    /// The robot's states, about 1 kHz.
    pub robot: Vec<RobotState>,
    /// The controller's cycles, each once.
    pub cycles: Vec<Cycle>,
    /// The controller's states, about 50 Hz.
    pub controller: Vec<ControllerState>,
    /// The daemons' heartbeats.
    pub daemon: Vec<Heartbeat>,
    /// The motions that the daemon publishes.
    pub motions: Vec<Published>,
    /// How the motions ended that the controller has received.
    pub results: Vec<MotionResult>,
    /// The daemon's plans, each with its request, where they are heard.
    pub plans: Vec<PlanRecord>,
}

/// A motion as the daemon publishes it.
#[derive(Clone, Debug)]
pub struct Published {
    /// Its id.
    pub id: u32,
    /// The plan that it is of.
    pub plan_id: u64,
    /// The motion that it leaves, with the path time of that, s; none where it begins at rest.
    pub leaves: Option<(u32, f64)>,
    /// When it is to begin, as published, nanoseconds.
    pub begin_mono_ns: i64,
    /// Its knots, s and rad.
    pub knots: Vec<Knot>,
}

impl From<&TrajectoryMessage> for Published {
    fn from(message: &TrajectoryMessage) -> Self {
        let in_motion = message.start == MotionStart::InMotion.code();
        // It is kept as it was published, also where that cannot be.
        let knots = message.knots.iter().take(message.knot_count as usize);
        Self {
            id: message.trajectory_id,
            plan_id: message.plan_id,
            begin_mono_ns: message.begin_mono_ns,
            leaves: in_motion.then_some((message.leaves_trajectory_id, message.leaves_at_s)),
            knots: knots.map(Knot::from).collect(),
        }
    }
}

impl Heard {
    fn append(&mut self, fresh: &mut Self) {
        self.setpoints.append(&mut fresh.setpoints);
        self.robot.append(&mut fresh.robot);
        self.cycles.append(&mut fresh.cycles);
        self.controller.append(&mut fresh.controller);
        self.daemon.append(&mut fresh.daemon);
        self.motions.append(&mut fresh.motions);
        self.results.append(&mut fresh.results);
        self.plans.append(&mut fresh.plans);
    }
}

/// Listens in a thread of its own until dropped: at a real-time priority where the system permits one, since the services keep
/// no more than 32 ms for it.
#[derive(Debug)]
pub struct Listener {
    heard: Arc<Mutex<Heard>>,
    quit: Arc<AtomicBool>,
    thread: Option<JoinHandle<Result<(), IpcError>>>,
}

impl Listener {
    /// Begins to listen; nobody needs to run yet.
    #[must_use]
    pub fn start(options: &IpcOptions) -> Self {
        Self::start_with(options, false)
    }

    /// The same, with the daemon's plans.
    #[must_use]
    pub fn start_with_plans(options: &IpcOptions) -> Self {
        Self::start_with(options, true)
    }

    fn start_with(options: &IpcOptions, hears_plans: bool) -> Self {
        let (heard, quit) = (Arc::<Mutex<Heard>>::default(), Arc::<AtomicBool>::default());
        let (options, shared, stop) = (options.clone(), Arc::clone(&heard), Arc::clone(&quit));
        let thread = thread::spawn(move || listen(&options, hears_plans, &shared, &stop));
        Self {
            heard,
            quit,
            thread: Some(thread),
        }
    }

    /// Looks at what was heard so far.
    pub fn with<T>(&self, look: impl FnOnce(&Heard) -> T) -> T {
        look(&self.heard.lock().unwrap())
    }

    /// What was heard since the last call of this.
    #[must_use]
    pub fn take(&self) -> Heard {
        std::mem::take(&mut *self.heard.lock().unwrap())
    }
}

impl Drop for Listener {
    fn drop(&mut self) {
        self.quit.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

struct Ports {
    setpoints: Subscriber<Setpoint>,
    robot: Subscriber<RobotState>,
    cycles: CycleSubscriber,
    controller: Subscriber<ControllerState>,
    heart: Subscriber<Heartbeat>,
    motions: Subscriber<TrajectoryMessage>,
    results: Subscriber<MotionResult>,
    plans: Option<Subscriber<PlanRecord>>,
    _node: IpcNode,
}

impl Ports {
    fn open(options: &IpcOptions, hears_plans: bool) -> Result<Self, IpcError> {
        let node = IpcNode::create(options, "test-listener")?;
        let plans = || observer_subscriber(&node, &plan_record_service(&node)?);
        Ok(Self {
            setpoints: subscriber(&node, &setpoint_service(&node)?)?,
            robot: subscriber(&node, &robot_state_service(&node)?)?,
            cycles: subscriber(&node, &cycle_service(&node)?)?,
            controller: subscriber(&node, &controller_state_service(&node)?)?,
            heart: subscriber(&node, &heartbeat_service(&node)?)?,
            motions: subscriber(&node, &trajectory_service(&node)?)?,
            results: subscriber(&node, &motion_result_service(&node)?)?,
            plans: hears_plans.then(plans).transpose()?,
            _node: node,
        })
    }

    /// What follows from something is received before it, so that no state is taken away without the set-point that it follows.
    fn drain(&self, into: &mut Heard) {
        while let Ok(Some(sample)) = self.robot.receive() {
            into.robot.push(*sample);
        }
        while let Ok(Some(sample)) = self.setpoints.receive() {
            into.setpoints.push(*sample);
        }
        while let Ok(Some(batch)) = self.cycles.receive() {
            into.cycles.extend_from_slice(batch.payload());
        }
        while let Ok(Some(sample)) = self.controller.receive() {
            into.controller.push(*sample);
        }
        while let Ok(Some(message)) = self.motions.receive() {
            into.motions.push(Published::from(&*message));
        }
        while let Ok(Some(result)) = self.results.receive() {
            into.results.push(*result);
        }
        if let Some(plans) = &self.plans {
            while let Ok(Some(record)) = plans.receive() {
                into.plans.push(*record);
            }
        }
        while let Ok(Some(beat)) = self.heart.receive() {
            if beat.kind == ProcessKind::Daemon.code() {
                into.daemon.push(*beat);
            }
        }
    }
}

fn listen(
    options: &IpcOptions,
    hears_plans: bool,
    heard: &Mutex<Heard>,
    quit: &AtomicBool,
) -> Result<(), IpcError> {
    let ports = Ports::open(options, hears_plans)?;
    // What is lost without it is counted by who looks at the numbers of the messages.
    let _ = use_fifo_priority(OF_A_WATCH);
    let mut fresh = Heard::default();
    while !quit.load(Ordering::Relaxed) {
        ports.drain(&mut fresh);
        // Who looks may be kept from its processor: it is not waited for.
        if let Ok(mut heard) = heard.try_lock() {
            heard.append(&mut fresh);
        }
        thread::sleep(Duration::from_millis(1));
    }
    Ok(())
}
