//! The supervision thread: publishes motions, receives the controller's state and the live scene, keeps the certificate of the motion
//! under way up to date and orders stops. It never plans. The daemon's heartbeats end when its rounds do.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use iceoryx2::port::update_connections::UpdateConnections;
use realtime::{reduce_wakeup_latency, use_fifo_priority};
use shared_types::clock::{STATE_LIFETIME_NS, mono_now_ns, suspended_ns, wall_now_ns};
use shared_types::codes::{LoopFault, LoopState};
use shared_types::ipc::{
    IpcNode, Publisher, Subscriber, controller_state_service, newest, publisher, subscriber,
    trajectory_service,
};
use shared_types::message::{ControllerState, TrajectoryMessage};
use shared_types::valid;

use super::active_time::ActiveTime;
use super::heartbeat::BackgroundError;
use super::later_stop::Surroundings;
use super::request::ExecutionRequest;
use super::robot_motion::{FollowedMotion, RobotMotion};
use super::rules::ExecutionRules;
use super::shared::Shared;
use super::stop_order::StopOrder;
use super::stop_reason::StopReason;
use super::supervised_motion::{MotionStatus, SupervisedMotion, is_fresh};
use crate::live_scene::{
    Arrival, LiveScene, MAX_SOURCES, Progress, SceneInbox, SceneMemory, SceneSnapshot,
};

/// Period of the supervision loop.
const ROUND_PERIOD: Duration = Duration::from_millis(1);
/// Time beyond the longest stop for which the ending daemon waits until the motion under way has ended.
const SHUTDOWN_TIMEOUT: Duration = Duration::from_secs(5);

/// What supervision and the service tell each other.
#[derive(Clone, Debug, Default)]
pub(crate) struct Told {
    pub(super) robot_motion: Shared<RobotMotion>,
    pub(super) live_scene: Shared<SceneSnapshot>,
    pub(super) orders: Shared<HeardOrders>,
    /// The last motion of the goal that was withdrawn last, which is stopped like those before it; 0: none.
    pub(super) withdrawn_id: Arc<AtomicU32>,
}

/// What the controller's newest state says of orders and of the daemon.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct HeardOrders {
    /// What was requested until then does not begin, nanoseconds.
    pub(crate) wanted_from_mono_ns: i64,
    /// Goals that were given until then are over, nanoseconds.
    pub(crate) goals_from_mono_ns: i64,
    /// Instance of the daemon whose motions are taken; 0: any.
    pub(crate) daemon_instance: u64,
}

impl From<&ControllerState> for HeardOrders {
    fn from(state: &ControllerState) -> Self {
        Self {
            wanted_from_mono_ns: state.wanted_from_mono_ns,
            goals_from_mono_ns: state.goals_from_mono_ns,
            daemon_instance: state.daemon_instance,
        }
    }
}

impl HeardOrders {
    /// Whether the controller takes motions of this daemon.
    pub(crate) fn is_of_daemon(&self, instance: u64) -> bool {
        [0, instance].contains(&self.daemon_instance)
    }
}

/// Whether a motion was published for a goal that was withdrawn, up to this motion of it (0: none), or is left by such a one.
fn is_withdrawn(id: u32, withdrawn_id: u32) -> bool {
    // Ids begin again after the largest; they follow the clock in steps of 10 ms.
    const TWO_DAYS: u32 = 1 << 24;
    withdrawn_id != 0 && withdrawn_id.wrapping_sub(id) < TWO_DAYS
}

/// Publishers and state of the thread.
pub(crate) struct Supervisor {
    pub(super) rules: ExecutionRules,
    /// The daemon's instance, as in its heartbeat.
    pub(super) instance: u64,
    pub(super) publisher: Publisher<TrajectoryMessage>,
    states: Subscriber<ControllerState>,
    inbox: SceneInbox,
    pub(super) stop_order: StopOrder,
    /// Counts the rounds of supervision, which the heartbeat thread watches.
    supervision_rounds: Arc<AtomicU64>,
    pub(super) state: Option<valid::ControllerState>,
    awake: ActiveTime,
    /// Active time at which the last fresh state came, nanoseconds.
    last_state_active_ns: i64,
    pub(super) live: LiveScene,
    pub(super) supervised: Option<SupervisedMotion>,
    /// The motion that is to leave the supervised one, until it has done so.
    pub(super) joining: Option<SupervisedMotion>,
    told: Told,
    pub(super) last_id: u32,
    state_refused: bool,
    late_controllers_fail: bool,
}

impl Supervisor {
    /// Opens the services and makes the ports, which stay in this thread.
    ///
    /// # Errors
    /// [`BackgroundError`]: a port, or a priority that was granted before.
    pub(crate) fn open(
        node: &IpcNode,
        memory: SceneMemory,
        rules: ExecutionRules,
        instance: u64,
        supervision_rounds: Arc<AtomicU64>,
        realtime_priority: Option<u8>,
        told: Told,
    ) -> Result<Self, BackgroundError> {
        if let Err(error) = reduce_wakeup_latency() {
            tracing::warn!("orders to stop: {error}");
        }
        if let Some(priority) = realtime_priority {
            use_fifo_priority(priority)?;
        }
        let (robot, expected) = (rules.padded.clone(), rules.scene_expected);
        let live = LiveScene::recall(memory, robot, expected, mono_now_ns());
        Ok(Self {
            rules,
            instance,
            publisher: publisher(node, &trajectory_service(node)?)?,
            states: subscriber(node, &controller_state_service(node)?)?,
            inbox: SceneInbox::open(node)?,
            stop_order: StopOrder::open(node)?,
            supervision_rounds,
            state: None,
            awake: ActiveTime::from(mono_now_ns()),
            last_state_active_ns: 0,
            live,
            supervised: None,
            joining: None,
            told,
            last_id: 0,
            state_refused: false,
            late_controllers_fail: false,
        })
    }

    /// Supervises until the sender of requests is dropped; then stops the motion under way and returns once it has ended.
    pub(crate) fn run(&mut self, requests: &Receiver<ExecutionRequest>) {
        loop {
            self.round();
            match requests.recv_timeout(ROUND_PERIOD) {
                Ok(requests) => self.answer(&requests),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
        }
        let stopping_s = self.supervised.as_ref().map_or(0.0, |own| own.stopping_s);
        let until = Instant::now() + SHUTDOWN_TIMEOUT + Duration::from_secs_f64(stopping_s);
        while Instant::now() < until {
            let is_silent = self.state_silence_ns() > STATE_LIFETIME_NS;
            let Some(supervised) = self.supervised.as_mut().filter(|_| !is_silent) else {
                // A controller that is held finds no daemon when it goes on, and stops.
                return;
            };
            supervised.request_stop(StopReason::DaemonEnds);
            self.round();
            std::thread::sleep(ROUND_PERIOD);
        }
    }

    fn answer(&mut self, requests: &ExecutionRequest) {
        let answer = self.take(&requests.selected, requests.until_mono_ns);
        // Who asked must not take the robot for idle any more.
        self.share_robot_motion(mono_now_ns());
        if let Ok(id) = answer
            && !requests.slot.deliver(id)
            && let Some(published) = self.joining.as_mut().or(self.supervised.as_mut())
        {
            published.request_stop(StopReason::CallerGone);
        }
        let _ = requests.answer.send(answer);
    }

    /// Active time since the last fresh state of the controller, nanoseconds.
    fn state_silence_ns(&self) -> i64 {
        self.awake.total_ns() - self.last_state_active_ns
    }

    /// One round of supervision: receives states and scenes, and checks the motion under way after each scene, so that many large scenes
    /// delay a small one by no more than the work on one of them.
    pub(super) fn round(&mut self) {
        self.connect();
        self.receive_controller_state();
        self.live.notice_suspension(suspended_ns(), mono_now_ns());
        self.live.attend(self.inbox.present(), mono_now_ns());
        self.inbox.receive();
        self.supervise();
        for _ in 0..MAX_SOURCES {
            let begun = mono_now_ns();
            self.inbox.receive();
            let Some(index) = self.inbox.next(begun) else {
                break;
            };
            self.process_scene(index);
            self.receive_controller_state();
            self.supervise();
            self.inbox.throttle(index, begun, mono_now_ns());
        }
        self.told.live_scene.set(self.live.snapshot());
    }

    fn connect(&mut self) {
        let connected = self.publisher.update_connections();
        if let Err(error) = &connected
            && !self.late_controllers_fail
        {
            tracing::warn!("a late controller may miss trajectories: {error:?}");
        }
        self.late_controllers_fail = connected.is_err();
    }

    /// Receives the newest state of the controller, refused where it is malformed; only a fresh one ends the controller's silence.
    fn receive_controller_state(&mut self) {
        let newest = newest(&self.states);
        let now = mono_now_ns();
        self.awake.look(now);
        let Some(newest) = newest else {
            return;
        };
        match valid::ControllerState::try_from(&newest) {
            Ok(state) => {
                let is_new = self.state.as_ref().is_none_or(|last| {
                    last.values.instance != state.values.instance
                        || last.values.stamp_mono_ns < state.values.stamp_mono_ns
                });
                if is_fresh(&state, now) && is_new {
                    self.last_state_active_ns = self.awake.total_ns();
                    self.state_refused = false;
                } else if !is_fresh(&state, now) && !self.state_refused {
                    self.state_refused = true;
                    let age_ms = (now - state.values.stamp_mono_ns) as f64 * 1e-6;
                    tracing::warn!("a controller's state says nothing of now: {age_ms:.0} ms old");
                }
                self.told.orders.set(HeardOrders::from(&state.values));
                self.state = Some(state);
            }
            Err(error) if !self.state_refused => {
                self.state_refused = true;
                tracing::warn!("a controller's state is refused: {error}");
            }
            Err(_) => {}
        }
    }

    fn process_scene(&mut self, index: usize) {
        let now = Arrival {
            mono_ns: mono_now_ns(),
            wall_ns: wall_now_ns(),
        };
        let live = &mut self.live;
        // A publisher that sent a scene and is not listed any more has ended.
        live.attend(self.inbox.present(), now.mono_ns);
        let (publisher, is_of_two) = self.inbox.publisher_of(index);
        if is_of_two {
            live.refuse_names_of(publisher);
        }
        self.inbox.judge(index, now.mono_ns, |wire, publisher| {
            live.take(wire, publisher, now)
        });
    }

    fn supervise(&mut self) {
        let now = mono_now_ns();
        let at_rest = self.stop_order.poll_reply(now);
        self.watch_joining(now);
        if let Some(reason) = self.end_reason(now, at_rest) {
            if let Some(supervised) = self.supervised.take() {
                tracing::info!("trajectory {} is over: {reason}", supervised.id);
            }
            self.stop_order.end();
        }
        self.check_safety(now);
        let active_ns = self.awake.total_ns();
        match self.stop_needed(now) {
            Some((id, reason)) => self.stop_order.send(id, reason, now, active_ns),
            None if self.supervised.is_some() => self.stop_order.pause(),
            None => self.stop_order.end(),
        }
        self.share_robot_motion(now);
        if !self.stop_order.is_ignored() {
            self.supervision_rounds.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// The trajectory that must be stopped now, and the reason.
    fn stop_needed(&self, now_mono_ns: i64) -> Option<(u32, StopReason)> {
        let own = self.supervised.as_ref();
        let state = self.state.as_ref();
        let state = state.filter(|state| is_fresh(state, now_mono_ns));
        let joining = self.joining.as_ref();
        let ids = [own, joining].map(|motion| motion.map(|motion| motion.id));
        if let Some(id) = unsupervised(state, ids) {
            return Some((id, StopReason::Unsupervised));
        }
        let own = own.filter(|own| own.status() != MotionStatus::Stopping)?;
        let joined = || joining.and_then(SupervisedMotion::stop_reason);
        Some((own.id, own.stop_reason().or_else(joined)?))
    }

    /// Why the motion under way has ended, where a fresh state or the reply to an order says that it has.
    fn end_reason(&mut self, now_mono_ns: i64, at_rest: bool) -> Option<&'static str> {
        let supervised = self.supervised.as_mut()?;
        let fresh = self.state.as_ref();
        let fresh = fresh.filter(|state| is_fresh(state, now_mono_ns));
        let status = fresh.map_or(supervised.status(), |state| supervised.update(state));
        match status {
            MotionStatus::Over(reason) => Some(reason),
            MotionStatus::Pending if at_rest => Some("it was taken back before its begin"),
            _ => None,
        }
    }

    /// Requests a stop of the motion under way where the controller, the scenes or the certificate ask for one.
    fn check_safety(&mut self, now_mono_ns: i64) {
        let is_silent = self.state_silence_ns() > STATE_LIFETIME_NS;
        let Some(supervised) = &mut self.supervised else {
            return;
        };
        if supervised.stop_reason().is_some() || supervised.status() == MotionStatus::Stopping {
            return;
        }
        if is_silent {
            supervised.request_stop(StopReason::ControllerSilent);
        }
        if supervised.is_overdue() {
            supervised.request_stop(StopReason::NotStarted);
        }
        let withdrawn_id = self.told.withdrawn_id.load(Ordering::Relaxed);
        if is_withdrawn(supervised.id, withdrawn_id) {
            supervised.request_stop(StopReason::GoalWithdrawn);
        }
        let inbox = &self.inbox;
        let has_pending = |publisher| inbox.has_pending(publisher, now_mono_ns);
        if let Some(absence) = self.live.absence_in_motion(now_mono_ns, has_pending) {
            supervised.request_stop(absence.into());
        }
        let progress = supervised.progress(now_mono_ns);
        let surroundings = Surroundings {
            rules: &self.rules,
            live: &self.live,
            now_mono_ns,
        };
        surroundings.check(supervised, progress);
        self.check_joining(now_mono_ns);
    }

    /// Tells the service what the robot does.
    fn share_robot_motion(&self, now_mono_ns: i64) {
        let fresh = self.state.as_ref();
        let fresh = fresh.filter(|state| is_fresh(state, now_mono_ns));
        self.told
            .robot_motion
            .set(fresh.map_or_else(RobotMotion::default, |state| {
                robot_motion(state, self.supervised.as_ref(), self.joining.is_some())
            }));
    }
}

/// What a robot does by a fresh state of its controller, while this daemon supervises `own`, which another motion `is_left` by.
pub(super) fn robot_motion(
    state: &valid::ControllerState,
    own: Option<&SupervisedMotion>,
    is_left: bool,
) -> RobotMotion {
    let values = &state.values;
    let followed = own.filter(|own| own.id == values.trajectory_id && own.stop_reason().is_none());
    match (state.state, followed) {
        (LoopState::Holding, _) if own.is_none() && state.fault == LoopFault::None => {
            RobotMotion::Holding(values.commanded_configuration_rad.into())
        }
        (LoopState::Executing, Some(own)) if !is_left => {
            let ordered = if values.paused == 0 {
                values.speed
            } else {
                0.0
            };
            RobotMotion::Following(FollowedMotion {
                trajectory_id: own.id,
                motion: Arc::clone(&own.motion),
                goals: Arc::clone(&own.goals),
                is_blocked: own.is_blocked,
                progress: Progress::told_by(values),
                fastest_rate: values.rate.max(ordered),
            })
        }
        (state_now, _) => RobotMotion::Busy {
            state: state_now,
            fault: state.fault,
            // A controller that starts holds at once where a robot is there, and its first words take some ms.
            passes: own.is_some() || state_now == LoopState::Starting,
            stopped_for: own.and_then(SupervisedMotion::stop_reason),
        },
    }
}

/// The trajectory that a fresh state reports as executing and that this daemon does not supervise: nobody would stop it for an obstacle.
fn unsupervised(fresh: Option<&valid::ControllerState>, own: [Option<u32>; 2]) -> Option<u32> {
    let state = fresh.filter(|state| state.state == LoopState::Executing)?;
    let id = state.values.trajectory_id;
    (!own.contains(&Some(id))).then_some(id)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::controller_state;

    #[test]
    fn all_motions_of_a_withdrawn_goal_are_stopped_and_no_later_one() {
        assert!(!is_withdrawn(7, 0), "nothing was withdrawn");
        assert!(is_withdrawn(7, 7) && is_withdrawn(6, 7));
        assert!(!is_withdrawn(8, 7));
        assert!(is_withdrawn(u32::MAX, 3), "ids begin again");
        assert!(!is_withdrawn(3, u32::MAX));
    }

    #[test]
    fn a_controller_that_starts_is_waited_for_and_one_in_fault_is_not() {
        let passes = |state: LoopState| {
            let state = controller_state(|values| values.state = state.code());
            match robot_motion(&state, None, false) {
                RobotMotion::Busy { passes, .. } => Some(passes),
                _ => None,
            }
        };
        assert_eq!(passes(LoopState::Starting), Some(true));
        assert_eq!(passes(LoopState::Fault), Some(false));
        assert_eq!(passes(LoopState::Stopping), Some(false));
        assert_eq!(passes(LoopState::Holding), None);
    }

    #[test]
    fn whatever_is_executed_and_not_its_own_is_unsupervised() {
        let state = |state: LoopState| {
            controller_state(|values| {
                (values.trajectory_id, values.state) = (7, state.code());
            })
        };
        let executing = state(LoopState::Executing);
        assert_eq!(unsupervised(Some(&executing), [None; 2]), Some(7));
        assert_eq!(unsupervised(Some(&executing), [Some(8), Some(9)]), Some(7));
        for own in [[Some(7), None], [Some(6), Some(7)]] {
            assert_eq!(unsupervised(Some(&executing), own), None);
        }
        assert_eq!(unsupervised(None, [None; 2]), None);
        for other in [LoopState::Holding, LoopState::Stopping, LoopState::Fault] {
            assert_eq!(unsupervised(Some(&state(other)), [None; 2]), None);
        }
    }
}
