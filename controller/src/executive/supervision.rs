//! What the executive supervises each cycle: the robot, the daemon, the guard, the loop's own punctuality.

use shared_types::clock::seconds;
use shared_types::codes::{LoopFault, LoopState, MotorState, Waiting};

use super::{
    CONSISTENCY_M, CycleInput, Executive, ROBOT_REPLY_TIMEOUT_NS, RobotSample, RobotUpdate,
    STAMP_ALLOWANCE_NS, StopOrigin,
};

/// Cycle time without a round of the guard, which makes one each millisecond, after which the motion is stopped, ns: longer than
/// ordinary programs keep the guard from a processor.
const GUARD_TIMEOUT_NS: i64 = 100_000_000;

impl Executive {
    /// Takes the robot's state, or counts its silence.
    pub(super) fn supervise_robot(&mut self, update: RobotUpdate<'_>) {
        let elapsed_ns = self.elapsed_ns();
        let counted_ns = elapsed_ns.min(2 * self.settings.period_ns);
        self.robot_silence_ns += counted_ns;
        match update {
            RobotUpdate::Nothing => {}
            RobotUpdate::State(sample) => {
                let paused_ns = elapsed_ns - counted_ns;
                match self.check_stamp(sample.stamp_ns, self.now_ns, paused_ns) {
                    Ok(()) => self.take_robot_state(sample),
                    Err(reason) => self.refuse_state(reason),
                }
            }
            RobotUpdate::Invalid => {
                self.refuse_state(Waiting::InvalidRobotState);
                if self.state != LoopState::Starting {
                    self.stop_for(LoopFault::InvalidRobotState);
                }
            }
        }
        self.watch_robot(self.now_ns);
    }

    /// Supervises daemon, guard and loop; returns whether this cycle came late.
    pub(super) fn supervise(&mut self, input: &CycleInput) -> bool {
        let elapsed_ns = self.elapsed_ns();
        if !input.daemon_alive {
            // An error says that there is nothing to stop.
            let _ = self.stop(StopOrigin::DaemonLost);
        }
        self.watch_guard(input.guard_rounds, elapsed_ns);
        self.watch_punctuality(elapsed_ns)
    }

    /// Latches `fault` (the first one stays) and stops along the trajectory.
    pub(super) fn stop_for(&mut self, fault: LoopFault) {
        if self.fault == LoopFault::None {
            self.fault = fault;
        }
        let origin = StopOrigin::Fault(fault);
        self.state = match self.state {
            LoopState::Executing | LoopState::Stopping => {
                self.give_up_join(origin);
                self.note_stop(origin);
                LoopState::Stopping
            }
            LoopState::Starting | LoopState::Holding | LoopState::Fault => {
                self.break_off(origin);
                LoopState::Fault
            }
        };
    }

    /// Checks that a robot state is newer than the one before, and recent: else it does not show that the robot lives. Its age is
    /// counted in cycle time, without the `paused_ns` by which this cycle is later than two periods.
    fn check_stamp(&self, stamp_ns: i64, now_ns: i64, paused_ns: i64) -> Result<(), Waiting> {
        if stamp_ns > now_ns + STAMP_ALLOWANCE_NS {
            return Err(Waiting::FutureRobotState);
        }
        if self.robot.is_some_and(|last| stamp_ns <= last.stamp_ns) {
            return Err(Waiting::RepeatedRobotState);
        }
        if now_ns - paused_ns - stamp_ns > self.settings.robot_lost_ns {
            return Err(Waiting::OldRobotState);
        }
        Ok(())
    }

    fn refuse_state(&mut self, reason: Waiting) {
        self.refused_state = Some(reason);
        self.refused_robot_states = self.refused_robot_states.wrapping_add(1);
    }

    fn take_robot_state(&mut self, sample: &RobotSample) {
        self.robot_silence_ns = 0;
        self.refused_state = None;
        self.slack_residual_m = self
            .map
            .slack_residual(&sample.measured_m[..self.map.count()]);
        self.robot = Some(*sample);
        if !self.attached {
            return;
        }
        if sample.state == MotorState::Following {
            self.followed = true;
            if self.state == LoopState::Starting {
                self.state = LoopState::Holding;
            }
            self.watch_tracking(sample);
        }
    }

    fn watch_tracking(&mut self, sample: &RobotSample) {
        // A command is extrapolated by the step cap at most: a robot without set-points goes on for no longer.
        let since_s = self.commanded_ns.map_or(0.0, |commanded_ns| {
            seconds((commanded_ns - sample.stamp_ns).max(-self.settings.step_cap_ns))
        });
        let expected = self.commanded.position - self.commanded.velocity * since_s;
        let error_rad = self
            .tracking
            .observe(sample.stamp_ns, &(sample.measured_rad - expected));
        if error_rad > self.path_tolerance_rad {
            self.stop_for(LoopFault::TrackingError);
        }
    }

    fn watch_robot(&mut self, now_ns: i64) {
        let Some(robot) = self.robot else {
            return;
        };
        let lost = self.is_robot_lost();
        if !self.attached {
            if self.state == LoopState::Starting && !lost {
                self.attach(now_ns, &robot);
            }
            return;
        }
        let moving = self.is_moving();
        if lost && moving {
            return self.stop_for(LoopFault::RobotLost);
        }
        if robot.state == MotorState::Fault {
            return self.detach(Some(LoopFault::RobotFault));
        }
        let has_stopped = self.followed && robot.state != MotorState::Following;
        let ignored = !self.followed && now_ns - self.attached_ns > ROBOT_REPLY_TIMEOUT_NS;
        if has_stopped {
            self.detach(moving.then_some(LoopFault::RobotRampedToRest));
        } else if lost || ignored {
            self.detach(None);
        }
    }

    /// Begins to send the robot's own reference, once that is at rest; holds as soon as the robot follows.
    fn attach(&mut self, now_ns: i64, robot: &RobotSample) {
        if self.reason_not_to_attach(robot) != Waiting::None {
            return;
        }
        self.mirror_robot();
        self.attached = true;
        self.followed = false;
        self.attached_ns = now_ns;
        self.tracking.restart();
    }

    /// Why the loop does not attach to a robot in this state; `Waiting::None` where it does.
    fn reason_not_to_attach(&self, robot: &RobotSample) -> Waiting {
        let moves = robot
            .accepted_velocity_m_s
            .iter()
            .any(|velocity| *velocity != 0.0);
        match robot.state {
            _ if robot.robot_hash != self.robot_hash => Waiting::OtherRobot,
            MotorState::Fault => Waiting::RobotFault,
            MotorState::Following => Waiting::RobotFollowsAnother,
            MotorState::RampingToRest => Waiting::RobotMoves,
            MotorState::Idle | MotorState::AtRestAfterLoss if moves => Waiting::RobotMoves,
            MotorState::Idle | MotorState::AtRestAfterLoss
                if self.accepted_residual_m(robot) > CONSISTENCY_M =>
            {
                Waiting::OffTendonMap
            }
            MotorState::Idle | MotorState::AtRestAfterLoss if self.is_off_reference(robot) => {
                Waiting::OffReference
            }
            MotorState::Idle | MotorState::AtRestAfterLoss => Waiting::None,
        }
    }

    /// Whether the tracking error would soon latch a fault if the loop attached to the robot.
    fn is_off_reference(&self, robot: &RobotSample) -> bool {
        let reference = self
            .map
            .configuration(&robot.accepted_m[..self.map.count()]);
        (robot.measured_rad - reference).norm() > self.settings.off_reference_limit_rad()
    }

    /// Distance of the robot's accepted set-point from the tendon lengths of every configuration, m.
    pub(super) fn accepted_residual_m(&self, robot: &RobotSample) -> f64 {
        self.map
            .slack_residual(&robot.accepted_m[..self.map.count()])
    }

    /// Why the robot is not held.
    pub(super) fn waiting(&self) -> Waiting {
        if self.attached && self.followed {
            return Waiting::None;
        }
        let live = self.robot.as_ref().filter(|_| !self.is_robot_lost());
        match live {
            None => self.refused_state.unwrap_or(Waiting::NoRobotState),
            Some(_) if self.attached => Waiting::NotTakenUp,
            Some(robot) => match self.reason_not_to_attach(robot) {
                Waiting::None => Waiting::NotTakenUp,
                reason => reason,
            },
        }
    }

    /// Detaches from a robot that takes no set-points any more: sends nothing, follows nothing, mirrors the robot's reference.
    pub(super) fn detach(&mut self, fault: Option<LoopFault>) {
        self.attached = false;
        self.followed = false;
        self.paused = false;
        self.break_off(fault.map_or(StopOrigin::RobotGone, StopOrigin::Fault));
        self.stop_origin = None;
        if let Some(fault) = fault
            && self.fault == LoopFault::None
        {
            self.fault = fault;
        }
        self.state = match self.fault {
            LoopFault::None => LoopState::Starting,
            _ => LoopState::Fault,
        };
    }

    /// Stops the motion where the guard is held up: neither a stop nor the loss of the daemon would reach the loop.
    fn watch_guard(&mut self, rounds: u64, elapsed_ns: i64) {
        self.guard_silence_ns += elapsed_ns.min(2 * self.settings.period_ns);
        if rounds != self.guard_rounds {
            self.guard_rounds = rounds;
            self.guard_silence_ns = 0;
        }
        let moves_or_will = self.is_moving() || self.motion.is_some();
        if self.guard_silence_ns > GUARD_TIMEOUT_NS && moves_or_will {
            self.stop_for(LoopFault::GuardHeldUp);
        }
    }

    fn watch_punctuality(&mut self, elapsed_ns: i64) -> bool {
        let late = elapsed_ns > self.settings.period_ns + self.settings.period_ns / 2;
        // A pause of the whole machine is one cycle, however long.
        let counted_ns = elapsed_ns.min(self.settings.step_cap_ns);
        self.late_run_ns = if late {
            self.late_run_ns + counted_ns
        } else {
            0
        };
        if self.is_moving() && self.late_run_ns > self.settings.late_run_ns {
            self.stop_for(LoopFault::TooLate);
        }
        late
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use shared_types::valid::Signature;

    use crate::fixtures::{MS, World, curved_motion, target_configuration};

    #[test]
    fn a_motion_that_waits_for_its_begin_is_given_back_when_the_daemon_is_lost() {
        let mut world = World::holding();
        let begin_ns = world.now_ns + 50 * MS;
        let motion = curved_motion(4, begin_ns, world.commanded(), target_configuration());
        assert!(world.executive.execute(motion).is_ok());
        world.run(10);
        assert!(world.executive.motion.is_some(), "the premise: it waits");
        world.daemon_alive = false;
        world.cycle(MS);
        assert!(world.executive.motion.is_none());
        world.daemon_alive = true;
        world.run(100);
        let last = world.last.as_ref().unwrap();
        assert_eq!((last.state, last.path_time_s), (LoopState::Holding, 0.0));
    }

    #[test]
    fn a_motion_that_nobody_could_stop_is_stopped_along_its_path() {
        let mut world = World::holding();
        world.begin_motion(4);
        world.run(300);
        assert_eq!(
            world.last.unwrap().state,
            LoopState::Executing,
            "the premise"
        );
        world.guard_held_up = true;
        world.run(100);
        assert_eq!(world.last.unwrap().state, LoopState::Executing);
        world.run(1);
        let last = world.last.unwrap();
        assert_eq!(last.fault, LoopFault::GuardHeldUp);
        assert_eq!(last.state, LoopState::Stopping);
        world.run(3_000);
        assert_eq!(world.last.unwrap().state, LoopState::Fault);
        world.guard_held_up = false;
        world.run(1);
        assert_eq!(world.executive.reset(Signature::UNSIGNED), Ok(()));
    }

    #[test]
    fn a_pause_of_the_whole_machine_is_no_guard_that_is_held_up() {
        let mut world = World::holding();
        world.begin_motion(4);
        world.run(300);
        world.guard_held_up = true;
        world.cycle(15 * MS);
        world.run(50);
        world.guard_held_up = false;
        world.run(20);
        assert_eq!(world.last.unwrap().fault, LoopFault::None);
    }

    #[test]
    fn a_motion_that_waits_for_its_begin_is_not_begun_while_nobody_could_stop_it() {
        let mut world = World::holding();
        world.guard_held_up = true;
        world.run(200);
        assert_eq!(
            world.last.unwrap().state,
            LoopState::Holding,
            "at rest it is no fault"
        );
        world.begin_motion(4);
        world.run(10);
        let last = world.last.unwrap();
        assert_eq!(
            (last.state, last.fault),
            (LoopState::Fault, LoopFault::GuardHeldUp)
        );
    }
}
