//! The service thread's loop: receives plan requests, validates and queues them, has them planned, answers, and has motions executed.

use std::mem;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::sleep;
use std::time::{Duration, Instant};

use iceoryx2::port::ReceiveError;
use realtime::reduce_timer_slack;
use shared_types::clock::mono_now_ns;
use shared_types::codes::Outcome;
use shared_types::ipc::{
    EventListener, EventNotifier, IpcError, IpcNode, PlanActiveRequest, PlanServer, event_listener,
    event_notifier, plan_answered_event, plan_asked_event, plan_server, plan_service,
};
use shared_types::valid::Asked;

use super::answer::Answer;
use super::asker::{Asker, AskerId};
use super::fair_queue::FairQueue;
use super::goal_exchange::GoalExchange;
use super::in_flight::{Attempt, InFlight, Queued};
use super::lead_times::LeadTimes;
use super::plan_records::PlanRecords;
use super::plan_runner::PlanRunner;
use super::recent_plans::RecentPlans;
use super::refusal::{Refusal, check_robot};
use super::request_validator::{PlanTask, RequestValidator};
use super::wait_mode::WaitMode;
use crate::execution::{Execution, RobotMotion};
use crate::identity::Identity;

/// Longest time between two rounds: requests without an event, and clients that cancelled, are found by then.
const POLL_INTERVAL: Duration = Duration::from_millis(1);
/// Time after which the running plan is truncated when the daemon ends.
const SHUTDOWN_GRACE_PERIOD: Duration = Duration::from_millis(500);

/// The service: its ports, queue, planner and handle of execution.
pub(crate) struct Service {
    server: PlanServer,
    /// Requests received in this round; kept for its allocation.
    received: Vec<PlanActiveRequest>,
    asked: EventListener,
    answered: EventNotifier,
    pub(super) execution: Execution,
    pub(super) runner: PlanRunner,
    pub(super) validator: RequestValidator,
    wait: WaitMode,
    pub(super) queue: FairQueue<AskerId, Queued>,
    pub(super) in_flight: Option<InFlight>,
    /// A request whose start is not known yet: the robot's motion is about to end or to be left.
    pub(super) deferred: Option<(Queued, Attempt)>,
    pub(super) lead_times: LeadTimes,
    identity: Identity,
    records: PlanRecords,
    pub(super) plans: RecentPlans,
    pub(super) next_plan_id: u64,
    pub(super) goal: GoalExchange,
    receiving_fails: bool,
    waiting_fails: bool,
    pub(super) ends: bool,
}

impl Service {
    /// Opens `plan` and its events with the capacity that the validator states; the ports stay in the calling thread.
    ///
    /// # Errors
    /// [`IpcError`].
    pub(crate) fn open(
        node: &IpcNode,
        validator: RequestValidator,
        runner: PlanRunner,
        execution: Execution,
        (lead_times, identity): (LeadTimes, Identity),
        wait: WaitMode,
        queued_per_client: usize,
    ) -> Result<Self, IpcError> {
        let plan = plan_service(node, &validator.capacity)?;
        let goal = GoalExchange::open(node, runner.robot(), identity.robot_hash)?;
        Ok(Self {
            goal,
            server: plan_server(node, &plan, &validator.capacity)?,
            received: Vec::new(),
            asked: event_listener(node, &plan_asked_event(node)?)?,
            answered: event_notifier(node, &plan_answered_event(node)?)?,
            execution,
            runner,
            validator,
            wait,
            queue: FairQueue::new(queued_per_client),
            in_flight: None,
            deferred: None,
            lead_times,
            records: PlanRecords::open(node, identity.instance)?,
            identity,
            plans: RecentPlans::default(),
            // Larger than the ids of every earlier daemon since the machine was booted.
            next_plan_id: mono_now_ns().unsigned_abs(),
            receiving_fails: false,
            waiting_fails: false,
            ends: false,
        })
    }

    /// Serves until `terminated` is set, then refuses the queued requests and answers the running plan.
    pub(crate) fn run(&mut self, terminated: &AtomicBool) {
        if let Err(error) = reduce_timer_slack() {
            tracing::warn!("looks and deadlines may be some 50 us late: {error}");
        }
        while !terminated.load(Ordering::Relaxed) {
            let answered = self.round();
            self.keep_warm();
            if !answered {
                self.pause();
            }
        }
        self.finish();
    }

    /// One round. Answers and cancellations come first: requests of a client beyond those that it may have at work are passed over by iceoryx2,
    /// and no event tells when they can be received. Returns whether a plan was answered that was known as soon as it was begun; another round is
    /// to follow it at once.
    fn round(&mut self) -> bool {
        while self.take_output() {}
        self.drop_cancelled();
        self.receive();
        self.answer_expired();
        self.keep_goal();
        self.make_way();
        while self.begin_next() {}
        self.take_output()
    }

    /// Keeps the workers warm while the robot moves.
    fn keep_warm(&mut self) {
        let is_idle = self.in_flight.is_none();
        if is_idle && matches!(self.execution.robot_motion(), RobotMotion::Following(_)) {
            self.runner.keep_warm();
        }
    }

    /// Takes the requests that have arrived up only once all are received: as long as so many of a client's are held as it may have at
    /// work, iceoryx2 passes over that client's others, so that a flooding client cannot keep out later ones.
    fn receive(&mut self) {
        loop {
            match self.server.receive() {
                Ok(Some(active)) => self.received.push(active),
                Ok(None) | Err(ReceiveError::ExceedsMaxBorrows) => {
                    self.receiving_fails = false;
                    break;
                }
                Err(error) => {
                    self.report_receiving(error);
                    break;
                }
            }
        }
        let mut received = mem::take(&mut self.received);
        for active in received.drain(..) {
            self.accept(active);
        }
        self.received = received;
    }

    fn report_receiving(&mut self, error: ReceiveError) {
        if !self.receiving_fails {
            tracing::error!("requests cannot be received: {error:?}");
        }
        self.receiving_fails = true;
    }

    /// Copies a request to private memory, checks the copy, and queues, executes or refuses it.
    fn accept(&mut self, active: PlanActiveRequest) {
        let received = Instant::now();
        let copy = *active.payload();
        let asked = Asked::try_from(&copy).map_err(Refusal::from);
        let own = self.identity.robot_hash;
        let of_this_robot = |asked: Asked| {
            check_robot("request", asked.robot_hash(), own)?;
            Ok(asked)
        };
        match asked.and_then(of_this_robot) {
            Err(refusal) => self.refuse(&Asker::Client(active), copy.request_id, &refusal),
            Ok(Asked::Execution(execution)) => self.execute_planned(&active, &execution),
            Ok(Asked::Plan(asked)) => match self.validator.validate(&asked, &self.plans) {
                Err(refusal) => self.refuse(&Asker::Client(active), copy.request_id, &refusal),
                Ok(task) => self.enqueue(active, task, received),
            },
        }
    }

    /// Queues a request that is to be planned, unless its client has too many waiting.
    fn enqueue(&mut self, active: PlanActiveRequest, task: PlanTask, received: Instant) {
        let asker = Asker::Client(active);
        let asker_id = asker.id();
        let queued = Queued {
            asker,
            task,
            received,
        };
        let Err(queued) = self.queue.push(asker_id, queued) else {
            return;
        };
        // What waits may have been cancelled meanwhile.
        self.drop_cancelled();
        if let Err(queued) = self.queue.push(asker_id, queued) {
            let reason = "the client has as many requests waiting as it may (queued_per_client)";
            let refusal = Refusal::new(Outcome::Overloaded, reason);
            self.refuse(&queued.asker, queued.task.request_id, &refusal);
        }
    }

    /// Forgets what waits for clients that gave up, and interrupts the plan of one.
    fn drop_cancelled(&mut self) {
        self.deferred
            .take_if(|(queued, _)| !queued.asker.is_waiting());
        let dropped = self.queue.take_out(|queued| !queued.asker.is_waiting());
        if !dropped.is_empty() {
            let count = dropped.len();
            tracing::debug!("{count} requests were cancelled while they waited");
        }
        if let Some(in_flight) = &self.in_flight
            && !in_flight.queued.asker.is_waiting()
        {
            in_flight.cancelled.store(true, Ordering::Relaxed);
        }
    }

    /// Answers queued requests whose deadline has passed, also while another client's long plan runs.
    fn answer_expired(&mut self) {
        let now = Instant::now();
        for late in self.queue.take_out(|queued| now >= queued.expires()) {
            self.answer_late(&late, now);
        }
        self.end_waiting(now);
    }

    pub(super) fn answer_late(&mut self, late: &Queued, now: Instant) {
        let mut answer = Answer::refused(late.task.request_id, &too_late(&late.task));
        answer.set_wait(now - late.received);
        self.send(&mut answer, &late.asker);
    }

    /// Sleeps until a request arrives, the planner has an output, or the poll interval or a queued deadline ends. The wake descriptor is
    /// polled only while a plan runs: before, it may still be readable for an output that was taken.
    fn pause(&mut self) {
        if self.wait == WaitMode::Poll {
            return std::hint::spin_loop();
        }
        let now = Instant::now();
        let until = |queued: &Queued| queued.expires().saturating_duration_since(now);
        let limit = self
            .queue
            .iter()
            .map(until)
            .fold(POLL_INTERVAL, Duration::min);
        let wake_fd = self.in_flight.is_some().then(|| self.runner.wake_fd());
        let waited = self.asked.wait(wake_fd, limit);
        if wake_fd.is_some() {
            self.runner.clear_wake();
        }
        match waited {
            Ok(_) => self.waiting_fails = false,
            Err(error) => {
                if !self.waiting_fails {
                    tracing::error!("requests are looked for only every ms: {error}");
                }
                self.waiting_fails = true;
                sleep(limit);
            }
        }
    }

    pub(super) fn refuse(&mut self, asker: &Asker, request_id: u64, refusal: &Refusal) {
        self.send(&mut Answer::refused(request_id, refusal), asker);
    }

    /// Gives an answer to who asked.
    pub(super) fn send(&mut self, answer: &mut Answer, asker: &Asker) {
        let outcome = answer.outcome();
        tracing::debug!(
            "{} candidates, outcome {:?}: {}",
            answer.candidates.len(),
            outcome,
            answer.report.reason.text()
        );
        match asker {
            Asker::Client(active) => self.send_to_client(answer, active),
            Asker::GoalKeeper(asked) => {
                self.goal.hear_answer(answer);
                answer.set_identity(self.identity);
                answer.set_hash();
                self.records.publish(asked, answer);
            }
        }
    }

    /// Sends an answer and notifies the waiting clients; a failure is logged, and the client sees its request end.
    pub(super) fn send_to_client(&self, answer: &mut Answer, active: &PlanActiveRequest) {
        answer.set_identity(self.identity);
        if let Err(error) = answer.send(active)
            && active.is_connected()
        {
            tracing::error!("{error}");
        }
        if let Err(error) = self.answered.notify() {
            tracing::error!("who waits for the answer finds it only some ms later: {error:?}");
        }
        if answer.outcome() != Some(Outcome::Early) {
            self.records.publish(active.payload(), answer);
        }
    }

    /// Refuses all queued requests because the daemon ends, and answers the running plan, truncated after the grace period.
    fn finish(&mut self) {
        self.ends = true;
        self.receive();
        let deferred = self.deferred.take().map(|(queued, _)| queued);
        let waiting = deferred.into_iter();
        let waiting: Vec<Queued> = waiting
            .chain(std::iter::from_fn(|| self.queue.pop()))
            .collect();
        for queued in waiting {
            let refusal = Refusal::new(Outcome::Cancelled, "the daemon ends");
            self.refuse(&queued.asker, queued.task.request_id, &refusal);
        }
        let begun = Instant::now();
        while let Some(in_flight) = &self.in_flight {
            if begun.elapsed() > SHUTDOWN_GRACE_PERIOD {
                in_flight.cancelled.store(true, Ordering::Relaxed);
            }
            if !self.take_output() {
                self.pause();
            }
        }
    }
}

fn too_late(task: &PlanTask) -> Refusal {
    let milliseconds = task.deadline.as_secs_f64() * 1e3;
    let reason = format!("the deadline of {milliseconds} ms passed while the request waited");
    Refusal::new(Outcome::Truncated, reason)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::task;

    #[test]
    fn a_request_whose_deadline_passed_in_the_queue_is_truncated() {
        let refusal = too_late(&task());
        assert_eq!(refusal.outcome, Outcome::Truncated);
        assert!(refusal.reason.contains("20 ms"), "{}", refusal.reason);
    }
}
