//! What a loop does in each cycle, wherever its set-points go: motions, orders and stops of the other threads, the executive, the report.

use std::sync::{Arc, atomic::Ordering};

use shared_types::{
    clock::mono_now_ns,
    codes::CommandRefusal,
    message::{RobotState, Setpoint},
    valid::Signature,
};

use super::{
    config::ControllerConfig,
    link::{Answer, LoopEnd, NumberedOrder, Order, Outcome, Report, Return, Shared},
    wire,
};
use crate::{
    arena::LoopMemory,
    executive::{
        BeginWindow, CycleInput, CycleOutput, Executive, Motion, RobotUpdate, StopOrigin,
        TrajectoryRefusal, check_still_valid,
    },
};

/// Where a cycle's robot state comes from and its set-point goes.
pub(super) trait RobotSide {
    /// The newest state of the robot that has arrived since the last cycle.
    fn newest_state(&mut self) -> Option<RobotState>;
    /// Sends a set-point.
    fn send(&mut self, setpoint: &Setpoint);
}

/// A loop's part of the controller: it follows trajectories, cycle by cycle.
pub(super) struct LoopStep {
    link: LoopEnd,
    executive: Executive,
    begin: BeginWindow,
    sequence: u64,
    setpoints_sent: u64,
    stops_seen: u64,
}

impl LoopStep {
    /// Follows nothing yet; to be called in the thread whose cycles these are.
    pub(super) fn new(config: &ControllerConfig, link: LoopEnd) -> Self {
        let thread_id = &link.shared.loop_thread_id;
        thread_id.store(realtime::thread_id(), Ordering::Relaxed);
        Self {
            link,
            executive: Executive::new(config.executive, &config.robot),
            begin: config.begin,
            sequence: 0,
            setpoints_sent: 0,
            stops_seen: 0,
        }
    }

    /// What all threads share.
    pub(super) fn shared(&self) -> &Arc<Shared> {
        &self.link.shared
    }

    /// One cycle, which was to begin at `deadline_ns`.
    pub(super) fn cycle(&mut self, deadline_ns: i64, robot: &mut impl RobotSide) -> CycleOutput {
        let now_ns = mono_now_ns();
        self.hear_robot(now_ns, robot);
        self.take_motions(now_ns);
        self.take_orders();
        self.take_stops();
        self.refuse_due_motion(now_ns);
        let output = self.executive.step(&CycleInput {
            daemon_alive: self.link.shared.daemon_alive.load(Ordering::Relaxed),
            guard_rounds: self.link.shared.guard_rounds.load(Ordering::Relaxed),
        });
        self.link.shared.set_loop_state(output.state);
        if output.send {
            self.setpoints_sent += 1;
            robot.send(&wire::setpoint(self.setpoints_sent, &output));
        }
        self.report(output, (now_ns - deadline_ns).max(0).unsigned_abs());
        self.give_back();
        output
    }

    fn hear_robot(&mut self, now_ns: i64, robot: &mut impl RobotSide) {
        let message = robot.newest_state();
        let sample = message.as_ref().and_then(wire::robot_sample);
        let update = match (&message, &sample) {
            (_, Some(sample)) => RobotUpdate::State(sample),
            (Some(_), None) => RobotUpdate::Invalid,
            (None, None) => RobotUpdate::Nothing,
        };
        self.executive.hear_robot(now_ns, update);
    }

    /// Hands this cycle's report to the relay, which began so much after its deadline.
    fn report(&mut self, output: CycleOutput, lateness_ns: u64) {
        let shared = &self.link.shared;
        self.sequence += 1;
        shared.cycles.store(self.sequence, Ordering::Relaxed);
        let report = Report {
            sequence: self.sequence,
            output,
            lateness_ns,
            setpoints_sent: self.setpoints_sent,
            memory: LoopMemory::counts(),
        };
        if self.link.reports.push(report).is_err() {
            shared.reports_lost.fetch_add(1, Ordering::Relaxed);
        }
    }

    fn take_motions(&mut self, now_ns: i64) {
        while let Ok(motion) = self.link.motions.pop() {
            if let Err((reason, motion)) = self.take_motion(motion, now_ns) {
                self.put_back(Return::Refused(reason, motion));
            }
        }
    }

    /// Takes a trajectory, once the checks are repeated whose outcome can have changed since the relay made them.
    #[expect(
        clippy::result_large_err,
        reason = "the trajectory goes back by value: boxing it would allocate in the loop"
    )]
    fn take_motion(
        &mut self,
        motion: Motion,
        now_ns: i64,
    ) -> Result<(), (TrajectoryRefusal, Motion)> {
        match check_still_valid(
            &motion,
            now_ns,
            &self.link.shared.guard_state(),
            &self.begin,
        ) {
            Ok(()) => self.executive.execute(motion),
            Err(reason) => Err((reason, motion)),
        }
    }

    /// Carries out orders that are still on offer; one that was withdrawn is skipped.
    fn take_orders(&mut self) {
        while let Ok(NumberedOrder { id, order }) = self.link.orders.pop() {
            if !self.link.shared.offer.take(id) {
                continue;
            }
            let result = match order {
                Order::Reset(ordered) => self.executive.reset(ordered),
                Order::Speed(speed) => self.executive.set_speed(speed),
                Order::Pause => self.executive.pause(),
                Order::Resume => self.executive.resume(),
            };
            let outcome = self.outcome(result);
            self.answer(Answer::Order { id, outcome });
        }
    }

    /// Obeys stops, after trajectories and orders: a stop also ends a motion that arrived while the loop was held up. While the threads end, nobody
    /// orders any more, and nothing is to begin.
    fn take_stops(&mut self) {
        if self.link.shared.is_quitting() {
            let _ = self.executive.stop(StopOrigin::Shutdown);
        }
        let up_to = self.link.shared.stops();
        if up_to == self.stops_seen {
            return;
        }
        self.stops_seen = up_to;
        let origin = self.take_stop_origin(up_to);
        let result = self.executive.stop(origin);
        let outcome = self.outcome(result);
        self.answer(Answer::Stops { up_to, outcome });
    }

    /// What has ordered the first of the stops up to this number that were not obeyed yet.
    fn take_stop_origin(&mut self, up_to: u64) -> StopOrigin {
        let mut first = None;
        while let Ok(noted) = self.link.stop_origins.peek()
            && noted.number <= up_to
        {
            first.get_or_insert(noted.origin);
            let _ = self.link.stop_origins.pop();
        }
        // Where the ring was full.
        first.unwrap_or(StopOrigin::Command(Signature::UNSIGNED))
    }

    /// Refuses a trajectory that is to begin now and is no longer valid: too late after a pause, or requested before a stop or reset.
    fn refuse_due_motion(&mut self, now_ns: i64) {
        let (guard, window) = (self.link.shared.guard_state(), self.begin.of_waiting());
        let check = |motion: &Motion| check_still_valid(motion, now_ns, &guard, &window);
        if let Some((reason, motion)) = self.executive.refuse_due(now_ns, check) {
            self.put_back(Return::Refused(reason, motion));
        }
    }

    fn outcome(&self, result: Result<(), CommandRefusal>) -> Outcome {
        Outcome {
            result,
            state: self.executive.state(),
        }
    }

    /// Sends an answer to the guard. The ring has room: the guard takes every answer before it orders again, and the answers to stops
    /// that it does not wait for (a shutdown's) may be lost.
    fn answer(&mut self, answer: Answer) {
        let _ = self.link.answers.push(answer);
    }

    fn give_back(&mut self) {
        while let Some(ended) = self.executive.take_finished() {
            self.put_back(Return::Ended(ended));
        }
    }

    /// Returns a trajectory to the relay; the ring has room for every trajectory in the process.
    fn put_back(&mut self, motion: Return) {
        let pushed = self.link.returns.push(motion);
        debug_assert!(pushed.is_ok(), "the ring of trajectories is full");
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use pcc_model::Configuration;
    use shared_types::codes::{LoopState, MotorState};

    use super::*;
    use crate::{
        executive::Ending,
        fixtures::{MS, curved_motion, target_configuration, unit_robot},
        service::link::{RelayEnd, link},
    };

    /// A robot at rest in the middle that tells a state when it is asked.
    struct PlayedRobot(MotorState);

    impl RobotSide for PlayedRobot {
        fn newest_state(&mut self) -> Option<RobotState> {
            Some(RobotState {
                stamp_mono_ns: mono_now_ns(),
                robot_hash: unit_robot().hash(),
                state: self.0.code(),
                ..RobotState::ZEROED
            })
        }

        fn send(&mut self, _: &Setpoint) {}
    }

    fn cycle(step: &mut LoopStep, state: MotorState) -> LoopState {
        let output = step.cycle(mono_now_ns(), &mut PlayedRobot(state));
        output.state
    }

    /// A loop at which a motion waits for its begin, and the relay's end.
    fn with_a_waiting_motion() -> (LoopStep, RelayEnd) {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/controller.toml");
        let config = ControllerConfig::from_file(&file).unwrap();
        let (at_loop, _guard, mut at_relay) = link();
        at_loop.shared.daemon_alive.store(true, Ordering::Relaxed);
        let mut step = LoopStep::new(&config, at_loop);
        cycle(&mut step, MotorState::Idle);
        let state = cycle(&mut step, MotorState::Following);
        assert_eq!(state, LoopState::Holding);
        let (begin_ns, start) = (mono_now_ns() + 500 * MS, Configuration::zeros());
        let mut waiting = curved_motion(7, begin_ns, start, target_configuration());
        waiting.requested_ns = mono_now_ns();
        at_relay.motions.push(waiting).unwrap();
        let state = cycle(&mut step, MotorState::Following);
        assert_eq!(state, LoopState::Holding);
        assert!(at_relay.returns.pop().is_err(), "it waits for its begin");
        (step, at_relay)
    }

    fn ending(at_relay: &mut RelayEnd) -> Ending {
        match at_relay.returns.pop() {
            Ok(Return::Ended(ended)) => ended.ending,
            _ => panic!("it is set aside"),
        }
    }

    #[test]
    fn a_robot_that_stopped_by_itself_is_seen_before_a_stop_is_obeyed() {
        let (mut step, mut at_relay) = with_a_waiting_motion();
        at_relay.shared.order_stop(mono_now_ns(), true);
        cycle(&mut step, MotorState::AtRestAfterLoss);
        let ending = ending(&mut at_relay);
        assert_eq!(ending, Ending::SetAside(StopOrigin::RobotGone));
    }

    #[test]
    fn nothing_begins_while_the_threads_end() {
        let (mut step, mut at_relay) = with_a_waiting_motion();
        at_relay.shared.quit.store(true, Ordering::Relaxed);
        cycle(&mut step, MotorState::Following);
        let ending = ending(&mut at_relay);
        assert_eq!(ending, Ending::SetAside(StopOrigin::Shutdown));
    }
}
