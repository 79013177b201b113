//! The turn of the goal that stays: its plans in the queue.

use std::sync::atomic::Ordering;
use std::time::Instant;

use shared_types::clock::mono_now_ns;
use shared_types::codes::Outcome;
use shared_types::message;
use shared_types::valid::PlanRequest;

use super::answer::Answer;
use super::asker::{Asker, AskerId};
use super::in_flight::Queued;
use super::refusal::Refusal;
use super::request_validator::PlanTask;
use super::service::Service;

impl Service {
    /// Hears goals, has what they want planned, and tells what becomes of them.
    pub(super) fn keep_goal(&mut self) {
        let heard = self.goal.hear();
        if let Some(id) = heard.stopped {
            self.execution.stop(id);
        }
        self.make_again(&heard.not_begun);
        // In this order: the orders are those of the robot's state, or later ones.
        let robot = self.execution.robot_motion();
        self.goal.keeper.hear_orders(self.execution.heard_orders());
        let now = mono_now_ns();
        self.give_up_overtaken_plan(now);
        if self.goal.keeper.has_goal()
            && let Some(request) = self.goal.keeper.next_plan(&robot, now)
        {
            self.ask_for_goal(request);
        }
        self.goal.tell(now);
    }

    /// Breaks the plan in work to the goal off where that is elsewhere by now.
    fn give_up_overtaken_plan(&mut self, now_mono_ns: i64) {
        if let Some(in_flight) = &self.in_flight
            && matches!(in_flight.queued.asker, Asker::GoalKeeper(_))
            && self
                .goal
                .keeper
                .overtakes(in_flight.has_motion_on_its_way(), now_mono_ns)
        {
            in_flight.cancelled.store(true, Ordering::Relaxed);
        }
    }

    /// Puts a plan to the goal into the queue.
    fn ask_for_goal(&mut self, mut request: PlanRequest) {
        // Where other plans came since then it begins anew.
        request.previous = request.previous.filter(|named| self.plans.has(named));
        let most = self.validator.capacity.candidates;
        request.candidate_count = request.candidate_count.min(most);
        let asker = match message::PlanRequest::try_from(&request) {
            Ok(asked) => Asker::GoalKeeper(Box::new(asked)),
            Err(invalid) => {
                return self.goal.hear_answer(&Answer::refused(0, &invalid.into()));
            }
        };
        let task = match self.validator.validate(&request, &self.plans) {
            Ok(task) => PlanTask {
                moves_end_of: self.goal.keeper.motion_to_target(),
                ..task
            },
            Err(refusal) => return self.refuse(&asker, 0, &refusal),
        };
        let queued = Queued {
            asker,
            task,
            received: Instant::now(),
        };
        if let Err(queued) = self.queue.push(AskerId::GoalKeeper, queued) {
            let refusal = Refusal::new(Outcome::Overloaded, "the queue is full");
            self.refuse(&queued.asker, 0, &refusal);
        }
    }
}
