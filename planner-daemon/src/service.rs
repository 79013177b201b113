//! The loop that serves plan requests: receives, refuses, hands over to planning, answers, hands over for execution.

use std::mem;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::sleep;
use std::time::{Duration, Instant};

use iceoryx2::identifiers::UniqueClientId;
use iceoryx2::port::ReceiveError;
use pcc_model::UnitRobot;
use planning::Candidate;
use realtime::sleep_punctually;
use shared_types::clock::mono_now_ns;
use shared_types::codes::Outcome;
use shared_types::ipc::{EventListener, EventNotifier, PlanActiveRequest, PlanServer};

use crate::admission::{Border, Order};
use crate::answer::{Answer, is_deliverable};
use crate::config::WaitMode;
use crate::execution::{Execution, ExecutionRefusal, Selected};
use crate::kept_plans::KeptPlans;
use crate::planning_at_work::{Early, Job, Planned, Planning, Product};
use crate::queue::FairQueue;
use crate::refusal::Refusal;

/// Time between two looks at requests that nobody told of, and at clients that gave up.
const ATTENTION: Duration = Duration::from_millis(1);
/// Work ends this long before the deadline, for the answer to be sent and seen; of short deadlines, half.
const WAY_BACK: Duration = Duration::from_micros(500);
/// So much sooner for each candidate, for it to be written and read.
const WAY_BACK_OF_A_CANDIDATE: Duration = Duration::from_micros(20);
/// Time that a plan under way gets when the daemon ends, before it is truncated.
const GRACE: Duration = Duration::from_millis(500);

/// A request that waits for its turn.
struct Queued {
    active: PlanActiveRequest,
    order: Order,
    received: Instant,
}

impl Queued {
    /// When work ends, so that the answer is there at the deadline.
    fn deadline(&self) -> Instant {
        let whole = self.order.deadline;
        self.received + (whole - way_back(self.order.request.candidates, whole))
    }
}

/// The request that is being planned.
struct InFlight {
    queued: Queued,
    waited: Duration,
    plan_id: u64,
    cancelled: Arc<AtomicBool>,
}

/// Everything that the loop works with.
pub(crate) struct Service {
    server: PlanServer,
    /// Of the round under way.
    received: Vec<PlanActiveRequest>,
    asked: EventListener,
    answered: EventNotifier,
    execution: Execution,
    planning: Planning,
    border: Border,
    /// In units of its section length.
    robot: UnitRobot,
    wait: WaitMode,
    queue: FairQueue<UniqueClientId, Queued>,
    in_flight: Option<InFlight>,
    plans: KeptPlans,
    next_plan_id: u64,
    receiving_fails: bool,
    waiting_fails: bool,
    ends: bool,
}

/// What [`Service::new`] joins.
pub(crate) struct Parts {
    pub(crate) server: PlanServer,
    pub(crate) asked: EventListener,
    pub(crate) answered: EventNotifier,
    pub(crate) execution: Execution,
    pub(crate) planning: Planning,
    pub(crate) border: Border,
    pub(crate) robot: UnitRobot,
    pub(crate) wait: WaitMode,
    pub(crate) queued_per_client: usize,
}

impl Service {
    pub(crate) fn new(parts: Parts) -> Self {
        Self {
            server: parts.server,
            received: Vec::new(),
            asked: parts.asked,
            answered: parts.answered,
            execution: parts.execution,
            planning: parts.planning,
            border: parts.border,
            robot: parts.robot,
            wait: parts.wait,
            queue: FairQueue::new(parts.queued_per_client),
            in_flight: None,
            plans: KeptPlans::default(),
            // Larger than those of every daemon before since this machine was booted.
            next_plan_id: mono_now_ns().unsigned_abs(),
            receiving_fails: false,
            waiting_fails: false,
            ends: false,
        }
    }

    /// Serves until `terminated`, then answers what is there.
    pub(crate) fn run(&mut self, terminated: &AtomicBool) {
        if let Err(error) = sleep_punctually() {
            tracing::warn!("looks and deadlines may be some 50 us late: {error}");
        }
        while !terminated.load(Ordering::Relaxed) {
            if !self.round() {
                self.pause();
            }
        }
        self.finish();
    }

    /// One look at everything; whether there was something to do.
    fn round(&mut self) -> bool {
        let received = self.receive();
        self.drop_cancelled();
        self.answer_late();
        let planned = self.take_plan();
        let begun = self.begin_next();
        received || planned || begun
    }

    /// Takes the requests that have arrived up only once all are received: as long as so many of a client's are held as it may have at
    /// work, iceoryx2 passes over that client's others, so that one who floods does not keep out who connected after it.
    fn receive(&mut self) -> bool {
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
        let is_any = !received.is_empty();
        for active in received.drain(..) {
            self.accept(active);
        }
        self.received = received;
        is_any
    }

    fn report_receiving(&mut self, error: ReceiveError) {
        if !self.receiving_fails {
            tracing::error!("requests cannot be received: {error:?}");
        }
        self.receiving_fails = true;
    }

    /// Copies a request to private memory, checks the copy, and queues or refuses it.
    fn accept(&mut self, active: PlanActiveRequest) {
        let received = Instant::now();
        let copy = *active.payload();
        let order = match self.border.admit(&copy, &self.plans) {
            Ok(order) => order,
            Err(refusal) => return self.refuse(&active, copy.request_id, &refusal),
        };
        let client = active.origin();
        let queued = Queued {
            active,
            order,
            received,
        };
        let Err(queued) = self.queue.push(client, queued) else {
            return;
        };
        // What waits may have been cancelled meanwhile.
        self.drop_cancelled();
        if let Err(queued) = self.queue.push(client, queued) {
            let reason = "the client has as many requests waiting as it may (queued_per_client)";
            let refusal = Refusal::new(Outcome::Overloaded, reason);
            self.refuse(&queued.active, queued.order.request_id, &refusal);
        }
    }

    /// Forgets what waits for clients that gave up, and interrupts the plan of one.
    fn drop_cancelled(&mut self) {
        let dropped = self.queue.take_out(|queued| !is_wanted(&queued.active));
        if !dropped.is_empty() {
            let count = dropped.len();
            tracing::debug!("{count} requests were cancelled while they waited");
        }
        if let Some(in_flight) = &self.in_flight
            && !is_wanted(&in_flight.queued.active)
        {
            in_flight.cancelled.store(true, Ordering::Relaxed);
        }
    }

    /// Answers what waited until its deadline, also while another client's long plan is under way.
    fn answer_late(&mut self) {
        let now = Instant::now();
        for late in self.queue.take_out(|queued| now >= queued.deadline()) {
            let mut answer = Answer::refused(late.order.request_id, &too_late(&late.order));
            answer.set_wait(now - late.received);
            self.send(&mut answer, &late.active);
        }
    }

    /// Hands the next request over to planning, if that is idle.
    fn begin_next(&mut self) -> bool {
        if self.in_flight.is_some() {
            return false;
        }
        let Some(queued) = self.queue.pop() else {
            return false;
        };
        let waited = queued.received.elapsed();
        let cancelled = Arc::new(AtomicBool::new(false));
        self.planning.begin(Job {
            problem: Arc::clone(&queued.order.problem),
            request: queued.order.request.clone(),
            deadline: queued.deadline(),
            early: self.early(&queued.order),
            cancelled: Arc::clone(&cancelled),
        });
        let plan_id = self.next_plan_id;
        self.next_plan_id += 1;
        self.in_flight = Some(InFlight {
            queued,
            waited,
            plan_id,
            cancelled,
        });
        true
    }

    fn early(&self, order: &Order) -> Option<Early> {
        let (count, order, robot) = (order.early?, order.clone(), self.robot.clone());
        Some(Early {
            count,
            is_deliverable: Box::new(move |candidate| is_deliverable(&order, candidate, &robot)),
        })
    }

    /// Answers what the plan under way has come to, if there is anything new.
    fn take_plan(&mut self) -> bool {
        if self.in_flight.is_none() {
            return false;
        }
        match self.planning.take() {
            Some(Product::Early(candidates)) => self.answer_early(candidates),
            Some(Product::Plan(planned)) => self.answer(planned),
            None => return false,
        }
        true
    }

    /// Answers the first certified candidates; the plan goes on.
    fn answer_early(&self, candidates: Vec<Candidate>) {
        let Some(in_flight) = &self.in_flight else {
            return;
        };
        let Queued { active, order, .. } = &in_flight.queued;
        let length = self.border.section_length_m;
        let mut answer = Answer::early(order, candidates, &self.robot, length);
        answer.set_plan_id(in_flight.plan_id);
        answer.set_wait(in_flight.waited);
        self.send(&mut answer, active);
    }

    fn answer(&mut self, planned: Planned) {
        let Some(in_flight) = self.in_flight.take() else {
            return;
        };
        if let Err(fault) = &planned {
            tracing::debug!("no plan: {fault}");
        }
        let plan_id = in_flight.plan_id;
        let queued = in_flight.queued;
        let length = self.border.section_length_m;
        let mut answer = Answer::of_plan(&queued.order, planned, &self.robot, length);
        answer.set_plan_id(plan_id);
        answer.set_wait(in_flight.waited);
        let has_candidates = answer.outcome().is_some_and(Outcome::has_candidates);
        if is_wanted(&queued.active) && has_candidates && answer.candidate_count() > 0 {
            self.execute(&queued, plan_id, &mut answer);
        }
        self.send(&mut answer, &queued.active);
        let selected = answer.selected().map(|(index, _)| index);
        self.plans.keep(plan_id, answer.candidates(), selected);
    }

    fn execute(&mut self, queued: &Queued, plan_id: u64, answer: &mut Answer) {
        let Some(to_execute) = queued.order.execution else {
            return;
        };
        let published = match answer.selected() {
            _ if self.ends => Err(ExecutionRefusal::DaemonEnds),
            Some((candidate_index, motion)) => self.execution.publish(Selected {
                motion: motion.clone(),
                candidate_index,
                plan_id,
                requested_mono_ns: to_execute.requested_mono_ns,
                begin: to_execute.begin,
            }),
            None => Err(ExecutionRefusal::NothingSelected),
        };
        match published {
            Ok(id) => {
                tracing::info!("trajectory {id} of plan {plan_id} is published for execution");
                answer.set_executed(id);
            }
            Err(refusal) => {
                tracing::info!("plan {plan_id} is not executed: {refusal}");
                answer.set_execution_refused(&refusal.to_string());
            }
        }
    }

    /// Waits until there is something to do, but no longer than until the next look at everything. Workers are listened to only
    /// while one has something to say: what they said of a plan that was taken before is still there to be read.
    fn pause(&mut self) {
        if self.wait == WaitMode::Poll {
            return std::hint::spin_loop();
        }
        let now = Instant::now();
        let until = |queued: &Queued| queued.deadline().saturating_duration_since(now);
        let limit = self.queue.iter().map(until).fold(ATTENTION, Duration::min);
        let told = self.in_flight.is_some().then(|| self.planning.told());
        let waited = self.asked.wait(told, limit);
        if told.is_some() {
            self.planning.has_heard();
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

    fn refuse(&self, active: &PlanActiveRequest, request_id: u64, refusal: &Refusal) {
        self.send(&mut Answer::refused(request_id, refusal), active);
    }

    /// Sends an answer and wakes who waits for one; what does not arrive is logged, the client sees its request end.
    fn send(&self, answer: &mut Answer, active: &PlanActiveRequest) {
        let outcome = answer.outcome();
        tracing::debug!(
            "{} candidates, outcome {:?}: {}",
            answer.candidate_count(),
            outcome,
            answer.reason()
        );
        if let Err(error) = answer.send(active)
            && is_wanted(active)
        {
            tracing::error!("{error}");
        }
        if let Err(error) = self.answered.notify() {
            tracing::error!("who waits for the answer finds it only some ms later: {error:?}");
        }
    }

    /// Answers the plan under way, and tells all who wait that the daemon ends.
    fn finish(&mut self) {
        self.ends = true;
        self.receive();
        while let Some(queued) = self.queue.pop() {
            let refusal = Refusal::new(Outcome::Cancelled, "the daemon ends");
            self.refuse(&queued.active, queued.order.request_id, &refusal);
        }
        let begun = Instant::now();
        while let Some(in_flight) = &self.in_flight {
            if begun.elapsed() > GRACE {
                in_flight.cancelled.store(true, Ordering::Relaxed);
            }
            if !self.take_plan() {
                self.pause();
            }
        }
    }
}

/// How long before a deadline of `whole` work on so many candidates ends.
fn way_back(candidates: usize, whole: Duration) -> Duration {
    let of_candidates = WAY_BACK_OF_A_CANDIDATE.mul_f64(candidates as f64);
    (WAY_BACK + of_candidates).min(whole / 2)
}

fn is_wanted(active: &PlanActiveRequest) -> bool {
    active.is_connected() && !active.has_disconnect_hint()
}

fn too_late(order: &Order) -> Refusal {
    let milliseconds = order.deadline.as_secs_f64() * 1e3;
    let reason = format!("the deadline of {milliseconds} ms passed while the request waited");
    Refusal::new(Outcome::Truncated, reason)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::order;

    #[test]
    fn work_ends_sooner_before_a_deadline_of_many_candidates_and_halfway_to_a_short_one() {
        let us = Duration::from_micros;
        assert_eq!(way_back(1, us(20_000)), us(520));
        assert_eq!(way_back(64, us(20_000)), us(1_780));
        assert_eq!(way_back(64, us(2_000)), us(1_000));
        assert_eq!(way_back(1, Duration::MAX), us(520));
        assert_eq!(way_back(1, Duration::ZERO), Duration::ZERO);
    }

    #[test]
    fn a_request_whose_deadline_passed_in_the_queue_is_truncated() {
        let refusal = too_late(&order());
        assert_eq!(refusal.outcome, Outcome::Truncated);
        assert!(refusal.reason.contains("20 ms"), "{}", refusal.reason);
    }
}
