//! The relay's view of the loop, from the loop's reports: the published state, its statistics, its log.

use std::sync::atomic::Ordering;

use pcc_model::Robot;
use shared_types::{
    clock::mono_now_ns,
    codes::{LoopFault, LoopState, Refusal, Waiting},
    lateness,
    message::{ControllerState, ReasonText},
};
use tracing::{error, info, warn};

use super::explain;
use super::link::{Report, Shared};
use crate::{
    arena::MemoryCounts,
    executive::{
        AcceptanceContext, CycleOutput, EndedMotion, ExecutiveSettings, GuardState,
        TrajectoryRefusal,
    },
};

/// Time after which a reason to wait is logged, ns: at a start each reason lasts for some cycles.
const LOG_WAITING_AFTER_NS: i64 = 500_000_000;

/// Why the loop does not hold the robot.
#[derive(Clone, Copy)]
struct WaitingFor {
    /// The reason to wait; `Waiting::None` where the loop holds the robot.
    reason: Waiting,
    /// Stamp of the first cycle with this reason, ns of CLOCK_MONOTONIC.
    since_ns: i64,
    /// Whether the reason was logged.
    is_logged: bool,
}

/// The loop as seen from outside.
pub(super) struct LoopView {
    settings: ExecutiveSettings,
    published: ControllerState,
    /// Stamp of the cycle in which the named motion was followed, ns of CLOCK_MONOTONIC.
    named_ns: i64,
    state: LoopState,
    fault: LoopFault,
    /// What happened when the fault was latched; empty without one.
    fault_reason: String,
    waiting: WaitingFor,
    late_run: u32,
    memory: MemoryCounts,
    latest: Option<Report>,
}

impl LoopView {
    pub(super) fn new(settings: ExecutiveSettings, robot: &Robot) -> Self {
        let mut published = ControllerState::ZEROED;
        published.speed = 1.0;
        published.period_ns = settings.period_ns.unsigned_abs();
        published.instance = mono_now_ns().unsigned_abs();
        published.robot_hash = robot.hash();
        Self {
            settings,
            published,
            named_ns: i64::MIN,
            state: LoopState::Starting,
            fault: LoopFault::None,
            fault_reason: String::new(),
            waiting: WaitingFor {
                reason: Waiting::None,
                since_ns: 0,
                is_logged: true,
            },
            late_run: 0,
            memory: MemoryCounts::default(),
            latest: None,
        }
    }

    /// Instance number that trajectories for this controller must bear: the time of its start, ns of CLOCK_MONOTONIC, which differs
    /// from that of every other controller.
    pub(super) fn instance(&self) -> u64 {
        self.published.instance
    }

    /// Checks that a trajectory is of this controller's robot.
    ///
    /// # Errors
    /// [`TrajectoryRefusal::OtherRobot`].
    pub(super) fn check_robot(&self, found: u64) -> Result<(), TrajectoryRefusal> {
        let expected = self.published.robot_hash;
        match found == expected {
            true => Ok(()),
            false => Err(TrajectoryRefusal::OtherRobot { found, expected }),
        }
    }

    /// Whether a motion is executed, by the newest cycle known.
    pub(super) fn is_executing(&self) -> bool {
        self.state == LoopState::Executing
    }

    /// The context that a trajectory is checked against; `None` before the first cycle.
    pub(super) fn acceptance_context(&self, guard: GuardState) -> Option<AcceptanceContext> {
        let output = &self.latest.as_ref()?.output;
        Some(AcceptanceContext {
            state: output.state,
            commanded_rad: output.commanded.position,
            trajectory_id: output.trajectory_id,
            path_time_s: output.path_time_s,
            now_ns: mono_now_ns(),
            guard,
        })
    }

    /// Whether the newest cycle known began after `time_ns`.
    pub(super) fn is_later_than(&self, time_ns: i64) -> bool {
        let latest = self.latest.as_ref();
        latest.is_some_and(|latest| latest.output.stamp_ns > time_ns)
    }

    /// Takes in one cycle.
    pub(super) fn observe(&mut self, report: Report) {
        let output = &report.output;
        if output.state != self.state {
            info!(from = %self.state, to = %output.state, trajectory = output.trajectory_id, "loop");
            self.state = output.state;
        }
        if output.fault != self.fault {
            self.note_fault(output);
        }
        self.log_waiting(output);
        if report.memory.system_operations != self.memory.system_operations {
            let count = report.memory.system_operations;
            warn!(count, "the loop touched system memory inside a cycle");
        }
        self.memory = report.memory;
        self.count_lateness(output.late, report.lateness_ns);
        let (id, stamp_ns) = (output.trajectory_id, output.stamp_ns);
        // What is followed from a switch on names its cycle, whether or not the motion that was left there has done so before.
        if id != 0 && stamp_ns >= self.named_ns {
            self.name(id, stamp_ns);
        }
        self.latest = Some(report);
    }

    /// Notes a motion that was followed to its end: no cycle names one that began and ended in the same late cycle.
    pub(super) fn note_ended(&mut self, ended: &EndedMotion) {
        if ended.stamp_ns > self.named_ns {
            self.name(ended.motion.id, ended.stamp_ns);
        }
    }

    /// Names the motion that was followed in the cycle of this stamp.
    fn name(&mut self, id: u32, stamp_ns: i64) {
        (self.published.trajectory_id, self.named_ns) = (id, stamp_ns);
    }

    fn note_fault(&mut self, output: &CycleOutput) {
        self.fault = output.fault;
        self.fault_reason.clear();
        if output.fault == LoopFault::None {
            return info!("fault cleared");
        }
        self.fault_reason = explain::fault(output, &self.settings);
        let (fault, reason) = (output.fault, &self.fault_reason);
        error!(%fault, reason, "fault latched until reset");
    }

    /// What happened when the latched fault was latched; empty without one.
    pub(super) fn fault_reason(&self) -> &str {
        &self.fault_reason
    }

    /// The path time of the loop on a trajectory, s; none where it does not follow it.
    pub(super) fn path_time_s(&self, trajectory_id: u32) -> Option<f64> {
        let output = &self.latest.as_ref()?.output;
        (output.trajectory_id == trajectory_id).then_some(output.path_time_s)
    }

    /// What happened where a fault is latched, and what the loop waits for where it does not hold the robot.
    fn reason(&self, output: &CycleOutput) -> String {
        let fault = self.fault_reason.as_str();
        if output.waiting == Waiting::None {
            return fault.to_owned();
        }
        let own_robot = self.published.robot_hash;
        match fault {
            "" => explain::waiting(output, &self.settings, own_robot),
            _ => {
                let allowed = explain::allowed(output, &self.settings, own_robot);
                format!("{fault}; not held: {allowed}")
            }
        }
    }

    fn log_waiting(&mut self, output: &CycleOutput) {
        let WaitingFor {
            reason,
            since_ns,
            is_logged,
        } = self.waiting;
        if output.waiting != reason {
            self.waiting = WaitingFor {
                reason: output.waiting,
                since_ns: output.stamp_ns,
                is_logged: output.waiting == Waiting::None,
            };
        } else if !is_logged && output.stamp_ns - since_ns > LOG_WAITING_AFTER_NS {
            self.waiting.is_logged = true;
            let waiting = explain::waiting(output, &self.settings, self.published.robot_hash);
            warn!("the robot is not taken hold of: {waiting}");
        }
    }

    fn count_lateness(&mut self, late: bool, lateness_ns: u64) {
        let bin = &mut self.published.lateness_histogram[lateness::bin_of(lateness_ns)];
        *bin = bin.saturating_add(1);
        self.late_run = if late { self.late_run + 1 } else { 0 };
        self.published.late_cycles += u32::from(late);
        self.published.longest_late_run = self.published.longest_late_run.max(self.late_run);
    }

    /// Whether another trajectory is followed or about to be joined, or the loop is in another state, than a state told that was
    /// published.
    pub(super) fn differs_from(&self, told: &ControllerState) -> bool {
        self.latest.as_ref().is_some_and(|latest| {
            let output = &latest.output;
            let now = [
                output.state.code(),
                output.pending_trajectory_id,
                self.published.trajectory_id,
                self.published.refused_trajectory_id,
            ];
            let then = [
                told.state,
                told.pending_trajectory_id,
                told.trajectory_id,
                told.refused_trajectory_id,
            ];
            now != then
        })
    }

    pub(super) fn refused(&mut self, trajectory_id: u32, refusal: Refusal) {
        self.published.refused_trajectory_id = trajectory_id;
        self.published.refusal = refusal.code();
    }

    /// The controller's state as it is published.
    pub(super) fn message(&self, shared: &Shared) -> ControllerState {
        let mut message = self.published;
        message.loop_thread_id = shared.loop_thread_id.load(Ordering::Relaxed);
        let guard = shared.guard_state();
        message.wanted_from_mono_ns = guard.wanted_from_ns;
        message.goals_from_mono_ns = shared.goals_from_ns();
        message.daemon_instance = guard.daemon_instance.unwrap_or(0);
        let Some(report) = &self.latest else {
            message.stamp_mono_ns = mono_now_ns();
            return message;
        };
        let output = &report.output;
        message.stamp_mono_ns = output.stamp_ns;
        message.cycle = report.sequence;
        message.state = output.state.code();
        message.fault = output.fault.code();
        message.commanded_configuration_rad = output.commanded.position.into();
        message.commanded_velocity_rad_s = output.commanded.velocity.into();
        message.commanded_tendon_m = output.tendon_m;
        message.measured_configuration_rad = output.measured_rad.into();
        message.tracking_error_rad = output.tracking_error_rad;
        message.slack_residual_m = output.slack_residual_m;
        message.splice_error_m = output.splice_error_m;
        message.trajectory_time_s = output.path_time_s;
        message.rate = output.rate;
        message.speed = output.speed;
        message.pending_trajectory_id = output.pending_trajectory_id;
        message.paused = u32::from(output.paused);
        message.setpoints_sent = report.setpoints_sent;
        message.loop_arena_allocations = report.memory.arena_allocations;
        message.loop_system_allocations = report.memory.system_operations;
        message.waiting = output.waiting.code();
        message.refused_robot_states = output.refused_robot_states;
        message.accepted_residual_m = output.accepted_residual_m;
        message.reason = ReasonText::new(&self.reason(output));
        message
    }
}
