//! Handing motions over for execution: what is refused, and the way to the thread that publishes and supervises.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::{Builder, JoinHandle};
use std::time::Duration;

use pcc_model::{Configuration, Robot};
use shared_types::clock::mono_now_ns;
use shared_types::codes::{LoopFault, LoopState};
use shared_types::ipc::{IpcNode, IpcOptions};
use shared_types::valid;
use trajectory::{RateLaw, Trajectory};

use crate::admission::Begin;
use crate::heartbeat::{BackgroundError, Progress};
use crate::live_scene::{SceneAbsence, SceneMemory};
use crate::supervision::is_fresh;
use crate::supervisor::Supervisor;

/// Largest distance of a motion's start from the commanded configuration, rad.
const START_TOLERANCE_RAD: f64 = 1e-6;
/// Clock time that one trajectory id stands for, nanoseconds: after 497 days of uptime they begin again.
const ID_STEP_NS: i64 = 10_000_000;
/// Time from a reason to stop until the controller brakes, s: its state is up to 20 ms old, and the order has a way to go.
const ORDER_S: f64 = 0.05;
/// Time within which supervision takes a motion up, or not at all: the heart stops sooner where it does not go on.
const ANSWER_WITHIN: Duration = Duration::from_millis(250);

/// Why a motion is planned but not published.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub(crate) enum ExecutionRefusal {
    /// There is no candidate to execute.
    #[error("no candidate is selected")]
    NothingSelected,
    /// Nobody would execute it.
    #[error("no controller: its state is missing or older than 200 ms")]
    ControllerAbsent,
    /// Nobody would stop it.
    #[error("nobody serves `command`: an order to stop would be lost")]
    CommandUnserved,
    /// The controller is not at rest.
    #[error("the controller is {state} (fault: {fault}); only a holding one takes a motion")]
    NotHolding { state: LoopState, fault: LoopFault },
    /// The motion published before is not over.
    #[error("trajectory {id} is still to be executed")]
    Busy { id: u32 },
    /// The motion would begin with a jump.
    #[error(
        "the start is {distance_rad:.3e} rad away from the commanded configuration; at most 1e-6 rad is allowed"
    )]
    StartsElsewhere { distance_rad: f64 },
    /// Nobody knows where the obstacles are.
    #[error(transparent)]
    NoScene(#[from] SceneAbsence),
    /// An obstacle of the live scene is in the way.
    #[error("the live scene is in the way: not certified free at {at_s:.3} s of the motion")]
    SceneInTheWay { at_s: f64 },
    /// Nobody would watch over the motion.
    #[error("the daemon ends")]
    DaemonEnds,
    /// The thread that watches over motions did not answer.
    #[error(
        "the supervision of motions does not answer: it is held; a motion that it has published all the same is taken back, or \
         stopped along its path"
    )]
    SupervisionHeld,
    /// Shared memory did not take it.
    #[error("the trajectory could not be published")]
    NotPublished,
}

/// Which motion is to be executed.
pub(crate) struct Selected {
    pub(crate) motion: Trajectory,
    pub(crate) candidate_index: usize,
    pub(crate) plan_id: u64,
    /// When the sender of the request was asked for it, nanoseconds of `CLOCK_MONOTONIC`.
    pub(crate) requested_mono_ns: i64,
    pub(crate) begin: Begin,
}

/// What every motion for execution must keep.
#[derive(Clone, Debug)]
pub(crate) struct ExecutionRules {
    /// The robot in units of its section length, its tubes grown by what covers the path tolerance.
    pub(crate) grown: Robot,
    pub(crate) section_length_m: f64,
    /// Tracking error that the certificate covers, rad in each bending pair.
    pub(crate) path_tolerance_rad: f64,
    /// How the controller stops a motion.
    pub(crate) rate_law: RateLaw,
    /// Least time between publishing and begin.
    pub(crate) begin_lead: Duration,
    /// Whether nothing may be executed without a live scene.
    pub(crate) scene_expected: bool,
}

impl ExecutionRules {
    /// Longest stop on a motion, with the time until it begins, s.
    pub(crate) fn stopping_s(&self, motion: &Trajectory) -> f64 {
        self.rate_law.longest_stop(motion.knots()) + ORDER_S
    }
}

/// The id of a motion on its way to the one who waits for it: either it is told, or the one who waits has given up before.
#[derive(Debug, Default)]
pub(crate) struct Claim(AtomicU64);

impl Claim {
    /// Neither told (ids are u32, at least 1) nor given up.
    const OPEN: u64 = 0;
    const GIVEN_UP: u64 = u64::MAX;

    /// Tells the id; false where nobody waits any more.
    pub(crate) fn tell(&self, id: u32) -> bool {
        self.settle(u64::from(id)).is_ok()
    }

    /// Gives up waiting; the id where it was told before.
    fn give_up(&self) -> Option<u32> {
        let told = self.settle(Self::GIVEN_UP).err()?;
        u32::try_from(told).ok()
    }

    fn settle(&self, value: u64) -> Result<u64, u64> {
        let order = Ordering::AcqRel;
        self.0
            .compare_exchange(Self::OPEN, value, order, Ordering::Acquire)
    }
}

/// A motion on its way to supervision, which answers.
pub(crate) struct Handed {
    pub(crate) selected: Selected,
    /// After this it is not wanted any more, nanoseconds of `CLOCK_MONOTONIC`.
    pub(crate) until_mono_ns: i64,
    pub(crate) claim: Arc<Claim>,
    pub(crate) answer: SyncSender<Result<u32, ExecutionRefusal>>,
}

/// The way to the thread that publishes motions and watches over them; ends it when dropped, once nothing moves.
pub(crate) struct Execution {
    to_supervision: Option<SyncSender<Handed>>,
    thread: Option<JoinHandle<()>>,
}

impl Execution {
    /// Starts the thread, with a node of its own, at a real-time priority if there is one; `instance` is the daemon's in its heartbeat.
    pub(crate) fn start(
        options: &IpcOptions,
        rules: ExecutionRules,
        instance: u64,
        progress: &Arc<Progress>,
        realtime_priority: Option<u8>,
    ) -> Result<Self, BackgroundError> {
        let node = IpcNode::create(options, "planner-daemon supervision")?;
        let (to_supervision, handed) = sync_channel(1);
        let progress = Arc::clone(progress);
        let (tell, told) = sync_channel(1);
        let memory = SceneMemory::open(options)?;
        let supervise = move || {
            let opened =
                Supervisor::open(&node, memory, rules, instance, progress, realtime_priority);
            match opened {
                Ok(mut supervisor) => {
                    let _ = tell.send(Ok(()));
                    supervisor.run(&handed);
                }
                Err(error) => {
                    let _ = tell.send(Err(error));
                }
            }
        };
        let builder = Builder::new().name("supervision".to_owned());
        let thread = builder.spawn(supervise)?;
        told.recv().map_err(io::Error::other)??;
        Ok(Self {
            to_supervision: Some(to_supervision),
            thread: Some(thread),
        })
    }

    /// Has a motion checked against the controller and the live scene and published, by the thread that watches over it from then on;
    /// returns its id.
    pub(crate) fn publish(&self, selected: Selected) -> Result<u32, ExecutionRefusal> {
        let (answer, answered) = sync_channel(1);
        let claim = Arc::<Claim>::default();
        let handed = Handed {
            selected,
            until_mono_ns: mono_now_ns() + ANSWER_WITHIN.as_nanos() as i64,
            claim: Arc::clone(&claim),
            answer,
        };
        let ways = self.to_supervision.as_ref();
        if ways.is_none_or(|way| way.try_send(handed).is_err()) {
            return Err(ExecutionRefusal::SupervisionHeld);
        }
        let answered = answered.recv_timeout(2 * ANSWER_WITHIN);
        answered.unwrap_or_else(|_| claim.give_up().ok_or(ExecutionRefusal::SupervisionHeld))
    }
}

impl Drop for Execution {
    /// Supervision stops what moves before it ends.
    fn drop(&mut self) {
        self.to_supervision = None;
        if let Some(thread) = self.thread.take() {
            // A thread that panicked has said so already.
            let _ = thread.join();
        }
    }
}

/// Whether a controller is there, idle, and where the motion starts; its instance.
pub(crate) fn check_controller(
    state: Option<&valid::ControllerState>,
    start: &Configuration,
    busy: Option<u32>,
    now_mono_ns: i64,
) -> Result<u64, ExecutionRefusal> {
    let state = state
        .filter(|state| is_fresh(state, now_mono_ns))
        .ok_or(ExecutionRefusal::ControllerAbsent)?;
    if let Some(id) = busy {
        return Err(ExecutionRefusal::Busy { id });
    }
    if state.state != LoopState::Holding || state.fault != LoopFault::None {
        return Err(ExecutionRefusal::NotHolding {
            state: state.state,
            fault: state.fault,
        });
    }
    let commanded = Configuration::from(state.values.commanded_configuration_rad);
    let distance_rad = (start - commanded).norm();
    if distance_rad > START_TOLERANCE_RAD {
        return Err(ExecutionRefusal::StartsElsewhere { distance_rad });
    }
    Ok(state.values.instance)
}

/// An id after the last one of this daemon (0: none) and after those of every daemon before on this machine since it was booted, as
/// long as none publishes more than a hundred trajectories a second. After the largest one ids begin again at 1; none of those that
/// the controller speaks of is used.
pub(crate) fn next_id(last_id: u32, spoken_of: [u32; 2], now_mono_ns: i64) -> u32 {
    let after = |id: u32| id.checked_add(1).unwrap_or(1);
    let steps = (now_mono_ns / ID_STEP_NS).rem_euclid(i64::from(u32::MAX));
    let by_clock = u32::try_from(steps + 1).unwrap_or(1);
    // By less than half the circle.
    let clock_is_ahead = (1..=u32::MAX / 2).contains(&by_clock.wrapping_sub(last_id));
    let mut id = if last_id == 0 || clock_is_ahead {
        by_clock
    } else {
        after(last_id)
    };
    while spoken_of.contains(&id) {
        id = after(id);
    }
    id
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::controller_state;

    const NOW: i64 = 5_000_000_000;

    fn holding() -> valid::ControllerState {
        controller_state(|values| {
            values.stamp_mono_ns = NOW - 20_000_000;
            values.state = LoopState::Holding.code();
            values.instance = 8;
            values.commanded_configuration_rad = [0.1; 6];
        })
    }

    fn check(state: Option<&valid::ControllerState>) -> Result<u64, ExecutionRefusal> {
        check_controller(state, &Configuration::repeat(0.1), None, NOW)
    }

    #[test]
    fn a_holding_controller_at_the_start_takes_a_motion() {
        assert_eq!(check(Some(&holding())), Ok(8));
    }

    #[test]
    fn every_other_controller_is_refused_with_its_reason() {
        use ExecutionRefusal as Refusal;
        assert_eq!(check(None), Err(Refusal::ControllerAbsent));
        let mut old = holding();
        old.values.stamp_mono_ns = NOW - 200_000_001;
        assert_eq!(check(Some(&old)), Err(Refusal::ControllerAbsent));
        let mut future = holding();
        future.values.stamp_mono_ns = NOW + 1;
        assert_eq!(check(Some(&future)), Err(Refusal::ControllerAbsent));
        let mut busy = holding();
        busy.state = LoopState::Executing;
        let refusal = check(Some(&busy)).unwrap_err();
        assert!(refusal.to_string().contains("executing"), "{refusal}");
        let mut faulty = holding();
        (faulty.state, faulty.fault) = (LoopState::Fault, LoopFault::RobotLost);
        let refusal = check(Some(&faulty)).unwrap_err();
        assert!(refusal.to_string().contains("robot lost"), "{refusal}");
        let elsewhere = Configuration::repeat(0.1 + 1e-6);
        let refusal = check_controller(Some(&holding()), &elsewhere, None, NOW).unwrap_err();
        assert!(refusal.to_string().contains("1e-6 rad"), "{refusal}");
        let start = Configuration::repeat(0.1);
        let refusal = check_controller(Some(&holding()), &start, Some(4), NOW).unwrap_err();
        assert_eq!(refusal, Refusal::Busy { id: 4 });
    }

    #[test]
    fn ids_grow_within_a_daemon_and_across_restarts() {
        let none = [0, 0];
        let first = next_id(0, none, NOW);
        assert_eq!(first, 501);
        assert_eq!(next_id(first, none, NOW), 502);
        assert!(next_id(0, none, NOW + 2 * ID_STEP_NS) > 502);
    }

    #[test]
    fn ids_begin_again_after_the_largest_and_never_meet_zero_or_one_in_use() {
        let none = [0, 0];
        let circle_ns = i64::from(u32::MAX) * ID_STEP_NS;
        let last_ns = circle_ns - 1;
        assert_eq!(next_id(0, none, last_ns), u32::MAX);
        assert_eq!(next_id(u32::MAX, none, last_ns), 1);
        assert_eq!(next_id(1, none, last_ns), 2, "the clock is behind the ids");
        assert_eq!(next_id(u32::MAX, none, circle_ns), 1);
        assert_eq!(next_id(2, none, circle_ns), 3);
        assert_eq!(next_id(u32::MAX - 1, [u32::MAX, 1], last_ns), 2);
        let mut id = next_id(0, none, last_ns - 3 * ID_STEP_NS);
        for step in 0..100 {
            let next = next_id(id, [id, 0], last_ns + (step - 3) * ID_STEP_NS / 2);
            assert!(next != 0 && next != id);
            id = next;
        }
        for now_ns in [i64::MAX, 40 * circle_ns] {
            assert_ne!(next_id(0, none, now_ns), 0);
        }
    }

    #[test]
    fn an_id_is_told_or_given_up_and_never_both() {
        let told = Claim::default();
        assert!(told.tell(7));
        assert_eq!(told.give_up(), Some(7));
        let given_up = Claim::default();
        assert_eq!(given_up.give_up(), None);
        assert!(!given_up.tell(7));
        assert_eq!(given_up.give_up(), None);
    }
}
