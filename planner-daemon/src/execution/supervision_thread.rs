//! The handle of the supervision thread.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::sleep;
use std::time::{Duration, Instant};

use collision::SceneError;
use planning::Problem;
use shared_types::clock::{mono_now_ns, suspended_ns};
use shared_types::ipc::{IpcNode, IpcOptions, JoinOnDrop, spawn_with_ports};

use super::heartbeat::BackgroundError;
use super::publication::LAG_ALLOWANCE_S;
use super::refusal::ExecutionRefusal;
use super::request::{ExecutionRequest, ReplySlot, SelectedMotion};
use super::robot_motion::{FollowedMotion, RobotMotion, Switch};
use super::rules::{ExecutionRules, ORDER_DELAY_S};
use super::shared::Shared;
use super::supervisor::{HeardOrders, Supervisor, Told};
use crate::live_scene::{ExpectedMotion, SceneMemory, Timing};

/// Time within which supervision must publish a motion; later it refuses it. Heartbeats stop sooner where supervision stalls.
const REPLY_TIMEOUT: Duration = Duration::from_millis(250);

/// Time for which a daemon that starts looks for a controller, which publishes its state every 20 ms.
const LOOKS_FOR_A_CONTROLLER: Duration = Duration::from_millis(60);
/// Longest wait until a controller has heard a daemon that starts.
const LONGEST_UNKNOWN: Duration = Duration::from_secs(1);

/// By how much a motion may be published earlier or later than was expected when it was planned, s.
const BEGIN_SLACK_S: f64 = 0.03;

/// When a motion is expected to begin that is planned now.
#[derive(Clone, Copy)]
pub(crate) enum ExpectedBegin<'a> {
    /// At rest, as soon as it is planned, and not before a time of `CLOCK_MONOTONIC`, nanoseconds, if one is given.
    AtRest {
        /// The earliest begin.
        not_before_mono_ns: Option<i64>,
    },
    /// In motion, as soon as it is planned.
    InMotion,
    /// Where it leaves the motion that is followed.
    AtSwitch(&'a FollowedMotion, Switch),
}

/// The handle of the supervision thread, which publishes motions and supervises them. Dropping it stops what moves and joins the thread.
pub(crate) struct Execution {
    /// Supervision stops what moves, and ends, once this is dropped: declared before the thread, which is joined when it is dropped,
    /// because fields are dropped in the order of their declaration.
    to_supervision: SyncSender<ExecutionRequest>,
    told: Told,
    rules: ExecutionRules,
    /// The daemon's instance, as in its heartbeat.
    instance: u64,
    _thread: JoinOnDrop,
}

impl Execution {
    /// Starts the thread, with a node of its own, at a real-time priority if there is one; `instance` is the daemon's in its heartbeat.
    pub(crate) fn start(
        options: &IpcOptions,
        rules: ExecutionRules,
        instance: u64,
        supervision_rounds: &Arc<AtomicU64>,
        realtime_priority: Option<u8>,
    ) -> Result<Self, BackgroundError> {
        let node = IpcNode::create(options, "planner-daemon supervision")?;
        let (to_supervision, requests) = sync_channel(1);
        let supervision_rounds = Arc::clone(supervision_rounds);
        let memory = SceneMemory::open(options, suspended_ns())?;
        let told = Told::default();
        let (shared, own_rules) = (told.clone(), rules.clone());
        let rounds = supervision_rounds;
        let open = move || {
            let priority = realtime_priority;
            Supervisor::open(&node, memory, rules, instance, rounds, priority, shared)
        };
        let work = move |mut supervisor: Supervisor| supervisor.run(&requests);
        let thread = spawn_with_ports("supervision", open, work)??;
        Ok(Self {
            to_supervision,
            told,
            rules: own_rules,
            instance,
            _thread: thread.into(),
        })
    }

    /// What the robot does, as supervision heard last.
    pub(crate) fn robot_motion(&self) -> RobotMotion {
        self.told.robot_motion.get()
    }

    /// What the robot does, to be read by other threads.
    pub(crate) fn shared_robot_motion(&self) -> Shared<RobotMotion> {
        self.told.robot_motion.clone()
    }

    /// What the controller's newest state says of orders.
    pub(crate) fn heard_orders(&self) -> HeardOrders {
        self.told.orders.get()
    }

    /// Waits until the controller that is there has heard this daemon's heart: it refuses what was requested before. Returns at once where
    /// none is there, and after a second in any case.
    pub(crate) fn wait_until_known(&self) {
        let begun = Instant::now();
        while begun.elapsed() < LONGEST_UNKNOWN {
            let is_there = !matches!(self.robot_motion(), RobotMotion::Unknown);
            if is_there && self.heard_orders().is_of_daemon(self.instance)
                || !is_there && begun.elapsed() > LOOKS_FOR_A_CONTROLLER
            {
                return;
            }
            sleep(Duration::from_millis(1));
        }
        tracing::warn!("the controller does not hear this daemon, and refuses its motions");
    }

    /// Has the supervision thread stop a motion, or the one that it is to leave, because its goal was withdrawn.
    pub(crate) fn stop(&self, trajectory_id: u32) {
        self.told
            .withdrawn_id
            .store(trajectory_id, Ordering::Relaxed);
    }

    /// Whether an obstacle of the live scene moves.
    pub(crate) fn live_scene_moves(&self) -> bool {
        self.told.live_scene.get().moves(mono_now_ns())
    }

    /// The problem of a motion whose planning takes `planning`, with the live scene's obstacles, and its begin where that is delayed because a ball can be at its start.
    ///
    /// # Errors
    /// [`SceneError`] where these are too many together with the problem's.
    pub(crate) fn with_live_scene(
        &self,
        problem: &Arc<Problem>,
        planning: Duration,
        begin: ExpectedBegin,
    ) -> Result<(Arc<Problem>, Option<i64>), SceneError> {
        let now = mono_now_ns();
        let soonest = now + (planning + self.rules.begin_lead).as_nanos() as i64;
        let timing = match begin {
            ExpectedBegin::AtRest { not_before_mono_ns } => {
                Timing::from_begin(not_before_mono_ns.map_or(soonest, |begin| begin.max(soonest)))
            }
            ExpectedBegin::InMotion => Timing::from_begin(soonest),
            ExpectedBegin::AtSwitch(followed, switch) => followed
                .progress
                .of_joining_motion(switch.path_time_s)
                .timing(),
        };
        let expected = ExpectedMotion {
            timing,
            slack_s: BEGIN_SLACK_S,
            lag_allowance_s: LAG_ALLOWANCE_S,
            order_delay_s: ORDER_DELAY_S,
            rate_law: &self.rules.rate_law,
        };
        let scenes = self.told.live_scene.get();
        let with_scene = scenes.in_problem(problem, &expected, now)?;
        let Some(mut with_scene) = with_scene else {
            return Ok((Arc::clone(problem), None));
        };
        let moving = &with_scene.moving;
        let rests = matches!(begin, ExpectedBegin::AtRest { .. });
        let delay_s = moving.delay_of_begin_s(&self.rules.padded, &with_scene.start);
        let delay_s = delay_s.filter(|delay_s| *delay_s > 0.0 && rests);
        if let Some(delay_s) = delay_s {
            with_scene.moving = moving.after(delay_s);
        }
        let begin = delay_s.map(|delay_s| timing.delayed(delay_s));
        Ok((Arc::new(with_scene), begin))
    }

    /// Has the supervision thread check a motion against the controller and the live scene, publish it and supervise it; returns its id.
    ///
    /// # Errors
    /// [`ExecutionRefusal`]: why it is not published.
    pub(crate) fn publish(&self, selected: SelectedMotion) -> Result<u32, ExecutionRefusal> {
        let (answer, answered) = sync_channel(1);
        let slot = Arc::<ReplySlot>::default();
        let requests = ExecutionRequest {
            selected,
            until_mono_ns: mono_now_ns() + REPLY_TIMEOUT.as_nanos() as i64,
            slot: Arc::clone(&slot),
            answer,
        };
        if self.to_supervision.try_send(requests).is_err() {
            return Err(ExecutionRefusal::SupervisionStalled);
        }
        let answered = answered.recv_timeout(2 * REPLY_TIMEOUT);
        answered.unwrap_or_else(|_| slot.abandon().ok_or(ExecutionRefusal::SupervisionStalled))
    }
}
