//! The loop thread: wake, receive, decide, send, report; nothing else.
//!
//! In a cycle it takes no lock, writes no log, makes no system call but its sleep (the clock is read through the vDSO)
//! and allocates only what iceoryx2's send does, from its own arena. When a robot comes or goes, the ports connect and
//! disconnect: that costs system calls once, in the cycle that sees it.

use std::sync::{Arc, atomic::Ordering};

use iceoryx2::port::update_connections::UpdateConnections;
use realtime::{Pages, reduce_wakeup_latency};
use shared_types::{
    clock::mono_now_ns,
    codes::CommandRefusal,
    ipc::{self, IpcError, IpcNode, IpcOptions, Publisher, Subscriber},
    message::{RobotState, Setpoint},
    valid::Signature,
};
use tracing::{info, warn};

use super::{
    config::ControllerConfig,
    link::{Answer, LoopEnd, NumberedOrder, Order, Outcome, Report, Return},
    wire,
};
use crate::{
    arena::LoopMemory,
    executive::{
        BeginWindow, CycleInput, Executive, Motion, StopOrigin, TrajectoryRefusal,
        check_still_valid,
    },
};

/// The loop's ports: only these, so that tools that come and go never touch the loop.
struct Ports {
    setpoint: Publisher<Setpoint>,
    robot_state: Subscriber<RobotState>,
    // Declared last: the node outlives its ports.
    _node: IpcNode,
}

impl Ports {
    fn open(options: &IpcOptions) -> Result<Self, IpcError> {
        let node = IpcNode::create(options, "controller-loop")?;
        let setpoint = ipc::publisher(&node, &ipc::setpoint_service(&node)?)?;
        let robot_state = ipc::subscriber(&node, &ipc::robot_state_service(&node)?)?;
        Ok(Self {
            setpoint,
            robot_state,
            _node: node,
        })
    }
}

/// The loop with everything it needs a cycle.
struct HardLoop {
    ports: Ports,
    link: LoopEnd,
    executive: Executive,
    begin: BeginWindow,
    sequence: u64,
    setpoints_sent: u64,
    stops_seen: u64,
}

/// The loop thread's state: the loop, and the memory that its cycles run on.
pub(super) struct LoopThread {
    config: Arc<ControllerConfig>,
    hard_loop: HardLoop,
    // Declared last: the arena outlives what was allocated from it.
    memory: LoopMemory,
}

impl LoopThread {
    /// Opens the ports, in the thread that is to run the loop.
    ///
    /// # Errors
    /// [`IpcError`] where a port cannot be made; once it runs it does not fail.
    pub(super) fn open(
        config: Arc<ControllerConfig>,
        options: &IpcOptions,
        link: LoopEnd,
    ) -> Result<Self, IpcError> {
        let Some(mut memory) = LoopMemory::claim() else {
            unreachable!("one loop a process");
        };
        let thread_id = &link.shared.loop_thread_id;
        thread_id.store(realtime::thread_id(), Ordering::Relaxed);
        // The ports' own blocks come from the arena, too: some are freed in the cycle that sees a robot go.
        let ports = memory.cycle(|| Ports::open(options))?;
        let hard_loop = HardLoop {
            ports,
            link,
            executive: Executive::new(config.executive, &config.robot),
            begin: config.begin,
            sequence: 0,
            setpoints_sent: 0,
            stops_seen: 0,
        };
        Ok(Self {
            config,
            hard_loop,
            memory,
        })
    }

    /// Runs until all threads are to end.
    pub(super) fn run(mut self) {
        let hard_loop = &mut self.hard_loop;
        self.memory.cycle(|| hard_loop.touch_ports());
        go_real_time(&self.config);
        let period_ns = self.config.executive.period_ns;
        info!(period_us = period_ns / 1_000, "loop begins");
        let mut deadline_ns = mono_now_ns() + period_ns;
        while !hard_loop.link.shared.is_quitting() {
            realtime::sleep_until(deadline_ns);
            self.memory.cycle(|| hard_loop.cycle(deadline_ns));
            deadline_ns = next_deadline(deadline_ns, mono_now_ns(), period_ns);
        }
        let ended = &hard_loop.link.shared.loop_has_ended;
        ended.store(true, Ordering::Release);
    }
}

/// The first deadline on the grid of periods that is still ahead.
fn next_deadline(deadline_ns: i64, now_ns: i64, period_ns: i64) -> i64 {
    let missed = (now_ns - deadline_ns).max(0) / period_ns;
    deadline_ns + (missed + 1) * period_ns
}

/// Takes processor, priority and memory as configured; warns about each that the system refuses, and goes on without.
fn go_real_time(config: &ControllerConfig) {
    let processor = config
        .processor
        .map_or(Ok(()), |processor| realtime::set_cpu_affinity(&[processor]));
    let priority = config
        .realtime_priority
        .map_or(Ok(()), realtime::use_fifo_priority);
    let memory = if config.lock_memory {
        realtime::lock_memory(Pages::All)
    } else {
        Ok(())
    };
    for refused in [processor, priority, memory, reduce_wakeup_latency()]
        .into_iter()
        .filter_map(Result::err)
    {
        warn!("{refused}");
    }
}

impl HardLoop {
    /// Connects to running peers, so that the first cycle need not.
    fn touch_ports(&mut self) {
        if let Err(error) = self.ports.setpoint.update_connections() {
            warn!(?error, "cannot connect the set-points yet");
        }
        let _ = ipc::newest(&self.ports.robot_state);
    }

    fn cycle(&mut self, deadline_ns: i64) {
        let now_ns = mono_now_ns();
        self.take_motions(now_ns);
        self.take_orders();
        self.take_stops();
        self.refuse_due_motion(now_ns);
        let message = ipc::newest(&self.ports.robot_state);
        let robot = message.as_ref().and_then(wire::robot_sample);
        let output = self.executive.step(&CycleInput {
            now_ns,
            robot: robot.as_ref(),
            robot_state_invalid: message.is_some() && robot.is_none(),
            daemon_alive: self.link.shared.daemon_alive.load(Ordering::Relaxed),
            guard_rounds: self.link.shared.guard_rounds.load(Ordering::Relaxed),
        });
        self.link.shared.set_loop_state(output.state);
        if output.send {
            self.setpoints_sent += 1;
            // A set-point that cannot be sent is missed by the robot, which says so.
            let _ = self
                .ports
                .setpoint
                .send_copy(wire::setpoint(self.setpoints_sent, &output));
        }
        self.give_back();
        self.sequence += 1;
        self.link
            .shared
            .cycles
            .store(self.sequence, Ordering::Relaxed);
        let report = Report {
            sequence: self.sequence,
            output,
            lateness_ns: (now_ns - deadline_ns).max(0).unsigned_abs(),
            setpoints_sent: self.setpoints_sent,
            memory: LoopMemory::counts(),
        };
        if self.link.reports.push(report).is_err() {
            self.link
                .shared
                .reports_lost
                .fetch_add(1, Ordering::Relaxed);
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
            self.give_back();
        }
    }

    /// Obeys stops, after trajectories and orders: a stop also ends a motion that arrived while the loop was held up.
    fn take_stops(&mut self) {
        let up_to = self.link.shared.stops();
        if up_to == self.stops_seen {
            return;
        }
        self.stops_seen = up_to;
        let origin = self.take_stop_origin(up_to);
        let result = self.executive.stop(origin);
        let outcome = self.outcome(result);
        self.answer(Answer::Stops { up_to, outcome });
        self.give_back();
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
    use super::*;

    #[test]
    fn deadlines_stay_on_the_grid_and_missed_ones_are_left_out() {
        let cases = [
            (0, 1_000),
            (999, 1_000),
            (1_000, 2_000),
            (5_300, 6_000),
            (-200, 1_000),
        ];
        for (now_ns, expected) in cases {
            assert_eq!(next_deadline(0, now_ns, 1_000), expected, "at {now_ns}");
        }
    }
}
