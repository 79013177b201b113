//! Publishing motions for execution, and stopping them when the live scene comes in their way.

use std::time::Duration;

use collision::Verdict;
use iceoryx2::port::update_connections::UpdateConnections;
use pcc_model::{Configuration, Robot};
use shared_types::clock::mono_now_ns;
use shared_types::codes::{LoopFault, LoopState};
use shared_types::ipc::{
    IpcError, IpcNode, Publisher, Subscriber, controller_state_service, publisher, scene_service,
    subscriber, trajectory_service,
};
use shared_types::message::{ControllerState, SceneMessage, TrajectoryMessage};
use shared_types::{PROTOCOL_VERSION, valid};
use trajectory::Trajectory;

use crate::admission::Begin;
use crate::live_scene::{LiveScene, Timing};
use crate::stop_order::StopOrder;
use crate::supervision::{Standing, Supervised, is_fresh};
use crate::wire;

/// Largest distance of a motion's start from the commanded configuration, rad.
const START_TOLERANCE_RAD: f64 = 1e-6;
/// Clock time that one trajectory id stands for, nanoseconds: u32 ids last 497 days of uptime.
const ID_STEP_NS: i64 = 10_000_000;

/// Why a motion is planned but not published.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub(crate) enum ExecutionRefusal {
    /// There is no candidate to execute.
    #[error("no candidate is selected")]
    NothingSelected,
    /// Nobody would execute it.
    #[error("no controller: its state is missing or older than 200 ms")]
    ControllerAbsent,
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
    /// An obstacle of the live scene is in the way.
    #[error("the live scene is in the way: not certified free at {at_s:.3} s of the motion")]
    SceneInTheWay { at_s: f64 },
    /// Nobody would watch over the motion.
    #[error("the daemon ends")]
    DaemonEnds,
    /// Shared memory did not take it.
    #[error("the trajectory could not be published")]
    NotPublished,
}

/// Which motion is to be executed.
pub(crate) struct Selected<'a> {
    pub(crate) motion: &'a Trajectory,
    pub(crate) candidate_index: usize,
    pub(crate) plan_id: u64,
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
    /// Least time between publishing and begin.
    pub(crate) begin_lead: Duration,
}

/// The daemon's ports to the controller and to the live scene.
pub(crate) struct Execution {
    rules: ExecutionRules,
    publisher: Publisher<TrajectoryMessage>,
    states: Subscriber<ControllerState>,
    scenes: Subscriber<SceneMessage>,
    stop_order: StopOrder,
    state: Option<valid::ControllerState>,
    live: LiveScene,
    supervised: Option<Supervised>,
    last_id: u32,
}

impl Execution {
    /// Opens the services and makes the ports, which stay in this thread.
    pub(crate) fn open(node: &IpcNode, rules: ExecutionRules) -> Result<Self, IpcError> {
        Ok(Self {
            rules,
            publisher: publisher(node, &trajectory_service(node)?)?,
            states: subscriber(node, &controller_state_service(node)?)?,
            scenes: subscriber(node, &scene_service(node)?)?,
            stop_order: StopOrder::open(node)?,
            state: None,
            live: LiveScene::default(),
            supervised: None,
            last_id: 0,
        })
    }

    /// Hears what is new and watches over the motion under way; call it about once a millisecond.
    pub(crate) fn attend(&mut self) {
        if let Err(error) = self.publisher.update_connections() {
            tracing::warn!("a late controller may miss trajectories: {error:?}");
        }
        self.receive();
        self.supervise();
    }

    fn receive(&mut self) {
        while let Ok(Some(sample)) = self.states.receive() {
            let copy: ControllerState = *sample;
            match valid::ControllerState::try_from(&copy) {
                Ok(state) => self.state = Some(state),
                Err(error) => tracing::warn!("a controller's state is refused: {error}"),
            }
        }
        while let Ok(Some(sample)) = self.scenes.receive() {
            let copy: Box<SceneMessage> = Box::new(*sample);
            match valid::Scene::try_from(copy.as_ref()) {
                Ok(scene) => self.live.replace(scene, self.rules.section_length_m),
                Err(error) => tracing::warn!("a scene is refused, the one before stays: {error}"),
            }
        }
    }

    fn supervise(&mut self) {
        let now = mono_now_ns();
        let obeyed = self.stop_order.attend(now);
        let Some(supervised) = &mut self.supervised else {
            return;
        };
        let standing = match supervised.standing(self.state.as_ref(), now) {
            Standing::Awaited if obeyed => Standing::Over("it was taken back before its begin"),
            standing => standing,
        };
        if let Standing::Over(reason) = standing {
            tracing::info!("trajectory {} is over: {reason}", supervised.id);
            self.supervised = None;
            return;
        }
        if !supervised.still_holds(standing, &self.live, &self.rules.grown, now) {
            self.stop_order.give(supervised.id, now);
        }
    }

    /// Publishes a motion after checking it against the controller and the live scene; returns its id.
    pub(crate) fn publish(&mut self, selected: &Selected) -> Result<u32, ExecutionRefusal> {
        self.receive();
        self.supervise();
        let now = mono_now_ns();
        let busy = self.supervised.as_ref().map(|supervised| supervised.id);
        let start = selected.motion.knots()[0].position;
        check_controller(self.state.as_ref(), &start, busy, now)?;
        let begin_mono_ns = self.begin(selected.begin, now);
        self.check_scene(selected.motion, begin_mono_ns)?;
        let id = next_id(self.last_id, now);
        self.send(selected, id, begin_mono_ns)?;
        self.last_id = id;
        let scene_changes = self.live.changes();
        let motion = selected.motion.clone();
        self.supervised = Some(Supervised::new(id, motion, begin_mono_ns, scene_changes));
        Ok(id)
    }

    fn begin(&self, begin: Begin, now_mono_ns: i64) -> i64 {
        let soonest = now_mono_ns + self.rules.begin_lead.as_nanos() as i64;
        match begin {
            Begin::Soon => soonest,
            Begin::NotBefore(time) => time.max(soonest),
        }
    }

    fn check_scene(&self, motion: &Trajectory, begin_mono_ns: i64) -> Result<(), ExecutionRefusal> {
        let timing = Timing::from_begin(begin_mono_ns);
        match self.live.certify(&self.rules.grown, motion, 0.0, timing) {
            Verdict::Free => Ok(()),
            Verdict::Colliding { at } | Verdict::Undecided { at } => {
                Err(ExecutionRefusal::SceneInTheWay { at_s: at })
            }
        }
    }

    fn send(
        &self,
        selected: &Selected,
        id: u32,
        begin_mono_ns: i64,
    ) -> Result<(), ExecutionRefusal> {
        let knots = selected.motion.knots();
        let mut message = TrajectoryMessage {
            protocol_version: PROTOCOL_VERSION,
            trajectory_id: id,
            plan_id: selected.plan_id,
            begin_mono_ns,
            knot_count: knots.len() as u32,
            candidate_index: selected.candidate_index as u32,
            path_tolerance_rad: self.rules.path_tolerance_rad,
            ..TrajectoryMessage::ZEROED
        };
        for (slot, knot) in message.knots.iter_mut().zip(knots) {
            *slot = wire::knot(knot);
        }
        match self.publisher.send_copy(message) {
            Ok(_) => Ok(()),
            Err(error) => {
                tracing::error!("trajectory {id} could not be published: {error:?}");
                Err(ExecutionRefusal::NotPublished)
            }
        }
    }
}

/// Whether a controller is there, idle, and where the motion starts.
fn check_controller(
    state: Option<&valid::ControllerState>,
    start: &Configuration,
    busy: Option<u32>,
    now_mono_ns: i64,
) -> Result<(), ExecutionRefusal> {
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
    Ok(())
}

/// An id larger than the last one and than those of every daemon before on this machine since it was booted, as long as
/// none publishes more than a hundred trajectories a second.
fn next_id(last_id: u32, now_mono_ns: i64) -> u32 {
    let by_clock = u32::try_from(now_mono_ns / ID_STEP_NS).unwrap_or(u32::MAX);
    by_clock.max(last_id.saturating_add(1))
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
            values.commanded_configuration_rad = [0.1; 6];
        })
    }

    fn check(state: Option<&valid::ControllerState>) -> Result<(), ExecutionRefusal> {
        check_controller(state, &Configuration::repeat(0.1), None, NOW)
    }

    #[test]
    fn a_holding_controller_at_the_start_takes_a_motion() {
        assert_eq!(check(Some(&holding())), Ok(()));
    }

    #[test]
    fn every_other_controller_is_refused_with_its_reason() {
        use ExecutionRefusal as Refusal;
        assert_eq!(check(None), Err(Refusal::ControllerAbsent));
        let mut old = holding();
        old.values.stamp_mono_ns = NOW - 200_000_001;
        assert_eq!(check(Some(&old)), Err(Refusal::ControllerAbsent));
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
        let first = next_id(0, NOW);
        assert_eq!(first, 500);
        assert_eq!(next_id(first, NOW), 501);
        assert!(next_id(0, NOW + 2 * ID_STEP_NS) > 501);
        assert_eq!(next_id(u32::MAX, NOW), u32::MAX);
    }
}
