//! Publication of motions for the controller, after their last checks.

use shared_types::PROTOCOL_VERSION;
use shared_types::clock::mono_now_ns;
use shared_types::codes::MotionStart;
use shared_types::message::TrajectoryMessage;

use super::controller_check::{check_controller, controller_there};
use super::refusal::ExecutionRefusal;
use super::request::SelectedMotion;
use super::robot_motion::{RobotMotion, Switch};
use super::supervised_motion::SupervisedMotion;
use super::supervisor::{HeardOrders, Supervisor, robot_motion};
use super::trajectory_id::next_id;
use crate::knots;
use crate::live_scene::{Certificates, Progress, RemainingMotion};

/// Delay of a motion behind its schedule that its certificate at publication includes, s: shorter pauses need no stop.
pub(super) const LAG_ALLOWANCE_S: f64 = 0.2;
/// Time for a published motion to reach the controller's loop, s (the relay looks every 0.25 ms): less ahead a switch is missed.
const ARRIVAL_S: f64 = 1e-3;

/// When and from where on a motion is to be followed.
struct Schedule {
    begin_mono_ns: i64,
    /// Instance of the controller that is to follow it.
    controller_instance: u64,
    progress: Progress,
}

impl Supervisor {
    /// Publishes a motion after checking it against the controller and the live scene as they are now; returns its id.
    pub(super) fn take(
        &mut self,
        selected: &SelectedMotion,
        until_mono_ns: i64,
    ) -> Result<u32, ExecutionRefusal> {
        self.round();
        let now = mono_now_ns();
        let schedule = match &selected.leaves {
            None => self.schedule_at_rest(selected, now)?,
            Some(switch) => self.schedule_switch(switch, now)?,
        };
        let heard = self.state.as_ref();
        let heard = heard.map(|state| HeardOrders::from(&state.values));
        let Some(heard) = heard.filter(|heard| heard.is_of_daemon(self.instance)) else {
            return Err(ExecutionRefusal::DaemonUnheard);
        };
        if selected.timing.requested_mono_ns <= heard.wanted_from_mono_ns {
            return Err(ExecutionRefusal::EndedByOrder);
        }
        if !self.stop_order.can_be_given() {
            return Err(ExecutionRefusal::CommandUnserved);
        }
        if let Some(absence) = self.live.absence(now) {
            return Err(absence.into());
        }
        // The longest stop takes long to find, and the certificate needs it among moving obstacles alone: else it is found once the motion is
        // on its way.
        let longest_stop_s = || self.rules.stopping_s(&selected.motion);
        let needed_s = self.live.moves().then(longest_stop_s);
        let certificates = self.certify(selected, schedule.progress, needed_s.unwrap_or(0.0))?;
        if mono_now_ns() > until_mono_ns {
            return Err(ExecutionRefusal::SupervisionStalled);
        }
        if let Some(switch) = &selected.leaves {
            // The checks took time, too.
            self.schedule_switch(switch, mono_now_ns())?;
        }
        let values = self.state.as_ref().map(|state| &state.values);
        let spoken_of = values.map_or([0; 2], |values| {
            [values.trajectory_id, values.refused_trajectory_id]
        });
        let id = next_id(self.last_id, spoken_of, now);
        self.send(selected, id, &schedule)?;
        let stopping_s = needed_s.unwrap_or_else(longest_stop_s);
        self.last_id = id;
        let motion = SupervisedMotion::new(
            id,
            selected,
            schedule.begin_mono_ns,
            schedule.controller_instance,
            certificates,
            stopping_s,
        );
        match selected.leaves {
            None => self.supervised = Some(motion),
            Some(_) => self.joining = Some(motion),
        }
        Ok(id)
    }

    /// The schedule of a motion that begins at rest.
    fn schedule_at_rest(
        &self,
        selected: &SelectedMotion,
        now_mono_ns: i64,
    ) -> Result<Schedule, ExecutionRefusal> {
        let busy = self.supervised.as_ref().map(|supervised| supervised.id);
        let start = selected.motion.knots()[0].position;
        let state = self.state.as_ref();
        let controller_instance =
            check_controller(state, self.rules.robot_hash, &start, busy, now_mono_ns)?;
        let soonest = now_mono_ns + self.rules.begin_lead.as_nanos() as i64;
        let wanted = selected.timing.begin_mono_ns.unwrap_or(soonest);
        let begin_mono_ns = wanted.max(soonest);
        Ok(Schedule {
            begin_mono_ns,
            controller_instance,
            progress: Progress::from_begin(begin_mono_ns),
        })
    }

    /// The schedule of a motion that leaves the one that is followed.
    fn schedule_switch(
        &self,
        switch: &Switch,
        now_mono_ns: i64,
    ) -> Result<Schedule, ExecutionRefusal> {
        let id = switch.trajectory_id;
        let state = controller_there(self.state.as_ref(), self.rules.robot_hash, now_mono_ns)?;
        let left = self.supervised.as_ref();
        let motion = robot_motion(state, left, self.joining.is_some());
        let (RobotMotion::Following(followed), Some(left)) = (motion, left) else {
            return Err(ExecutionRefusal::NotFollowed { id });
        };
        if followed.trajectory_id != id {
            return Err(ExecutionRefusal::NotFollowed { id });
        }
        let ahead_s = switch.path_time_s - followed.latest_s(now_mono_ns);
        if ahead_s < ARRIVAL_S * followed.fastest_rate {
            return Err(ExecutionRefusal::SwitchMissed { id, ahead_s });
        }
        Ok(Schedule {
            begin_mono_ns: now_mono_ns + (ahead_s / followed.fastest_rate.max(0.05) * 1e9) as i64,
            controller_instance: state.values.instance,
            progress: left.progress_of_joining_motion(switch, now_mono_ns),
        })
    }

    fn certify(
        &self,
        selected: &SelectedMotion,
        progress: Progress,
        stopping_s: f64,
    ) -> Result<Certificates, ExecutionRefusal> {
        let mut certificates = Certificates::default();
        let rest = RemainingMotion {
            padded: &self.rules.padded,
            motion: &selected.motion,
            progress,
            stopping_s,
            lag_allowance_s: LAG_ALLOWANCE_S,
        };
        self.live.certify(&rest, &mut certificates)?;
        Ok(certificates)
    }

    fn send(
        &self,
        selected: &SelectedMotion,
        id: u32,
        schedule: &Schedule,
    ) -> Result<(), ExecutionRefusal> {
        let knots = selected.motion.knots();
        let mut message = TrajectoryMessage {
            protocol_version: PROTOCOL_VERSION,
            trajectory_id: id,
            plan_id: selected.plan_id,
            controller_instance: schedule.controller_instance,
            daemon_instance: self.instance,
            robot_hash: self.rules.robot_hash,
            requested_mono_ns: selected.timing.requested_mono_ns,
            begin_mono_ns: schedule.begin_mono_ns,
            knot_count: knots.len() as u32,
            draw: selected.draw as u32,
            path_tolerance_rad: self.rules.path_tolerance_rad,
            ..TrajectoryMessage::ZEROED
        };
        if let Some(switch) = &selected.leaves {
            message.start = MotionStart::InMotion.code();
            message.leaves_trajectory_id = switch.trajectory_id;
            message.leaves_at_s = switch.path_time_s;
        }
        message.knots[..knots.len()].copy_from_slice(knots::to_wire(knots));
        match self.publisher.send_copy(message) {
            Ok(_) => Ok(()),
            Err(error) => {
                tracing::error!("trajectory {id} could not be published: {error:?}");
                Err(ExecutionRefusal::NotPublished)
            }
        }
    }
}
