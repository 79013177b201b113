//! A request that waits for its turn, and the one that is being planned.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use planning::Candidate;

use super::asker::Asker;
use super::lead_times::{PlanKind, Work, lead_of_the_same_work};
use super::recent_plans::PlanBegin;
use super::request_validator::PlanTask;
use crate::execution::ExecutionRefusal;
use shared_types::codes::{PlanDependence, Sampler};

/// Time before the deadline at which planning ends, for the answer to be sent and received; at most half of the deadline.
const DELIVERY_MARGIN: Duration = Duration::from_micros(500);
/// Addition to [`DELIVERY_MARGIN`] for each candidate, for its knots to be written and read.
const DELIVERY_MARGIN_PER_CANDIDATE: Duration = Duration::from_micros(20);
/// Longest wait of appended goals for a switch that is under way; it does not count against their deadline.
const LONGEST_WAIT_OF_GOALS: Duration = Duration::from_millis(600);
/// Longest wait of other requests until the robot can be left.
const LONGEST_WAIT: Duration = Duration::from_millis(100);
/// Times that a request is planned whose plan comes too late for its switch or for the live scene.
pub(super) const ATTEMPTS: u32 = 8;

/// A request that waits for its turn.
pub(super) struct Queued {
    pub(super) asker: Asker,
    pub(super) task: PlanTask,
    pub(super) received: Instant,
}

impl Queued {
    /// When planning that began after such a wait must end, so that the answer arrives by the deadline.
    pub(super) fn deadline(&self, waited: Duration) -> Instant {
        let whole = self.task.deadline;
        let planning = whole - delivery_margin(self.task.request.candidates, whole);
        let excused = if self.task.appends {
            waited.min(LONGEST_WAIT_OF_GOALS)
        } else {
            Duration::ZERO
        };
        self.received + planning + excused
    }

    /// When it is answered where it still waits for its turn.
    pub(super) fn expires(&self) -> Instant {
        self.deadline(Duration::MAX)
    }

    /// Whether it may go on waiting for the robot.
    pub(super) fn can_wait(&self, now: Instant) -> bool {
        let longest = if self.task.appends {
            LONGEST_WAIT_OF_GOALS
        } else {
            LONGEST_WAIT
        };
        now < (self.received + longest).min(self.expires())
    }

    /// What decides how long it takes until its motion can be executed, which may be before the plan is complete.
    pub(super) fn kind(&self, selects_early: bool) -> PlanKind {
        PlanKind {
            sampler: self.task.request.sampler,
            has_several_goals: self.task.has_several_goals(),
            work: match (&self.asker, self.task.request.sampler) {
                (_, Sampler::Default) if selects_early => Work::StraightSegments,
                (Asker::GoalKeeper(_), _) => Work::WholePlanToKeptGoal,
                (Asker::Client(_), _) => Work::WholePlan,
            },
        }
    }

    /// Whether the motion that is followed is to be left for it, wherever that is.
    pub(super) fn leaves_motion(&self) -> bool {
        let task = &self.task;
        task.requested_mono_ns.is_some() && task.starts_at_robot && !task.appends
    }

    /// Whether its motion is to be executed before the plan is complete, where it begins in motion. The candidates of an early answer would
    /// begin elsewhere.
    pub(super) fn wants_early_selection(&self) -> bool {
        let has_early_answer = self.task.early.is_some();
        !has_early_answer && self.task.executes_fastest() && !self.task.has_several_goals()
    }
}

/// The request that is being planned.
pub(super) struct InFlight {
    pub(super) queued: Queued,
    /// What is done until its motion is handed over for publication, from when it was chosen where that begins; none where it has become
    /// something else, of which nothing can be learned.
    pub(super) kind: Option<PlanKind>,
    pub(super) begin_chosen: Instant,
    /// Time from then until its motion was published, or refused.
    pub(super) took: Duration,
    pub(super) waited: Duration,
    pub(super) plan_id: u64,
    /// How its candidates begin.
    pub(super) begin: PlanBegin,
    /// What its plan depends on beside its request.
    pub(super) depends_on: PlanDependence,
    pub(super) attempt: Attempt,
    pub(super) cancelled: Arc<AtomicBool>,
    /// What became of the motion that was to be executed before the plan was complete.
    pub(super) executed: Option<EarlyExecution>,
    /// Whether it was broken off for a request that is to leave its motion.
    pub(super) makes_way: bool,
}

/// How often a request has been planned, this time included, since its plans came too late.
#[derive(Clone, Copy)]
pub(super) struct Attempt {
    number: u32,
    /// Time that the one before took from the choice of its switch until its motion was refused.
    took_before: Duration,
}

impl Attempt {
    pub(super) const FIRST: Self = Self {
        number: 1,
        took_before: Duration::ZERO,
    };

    /// The next one; none where it was the last.
    pub(super) fn next(self, took: Duration) -> Option<Self> {
        let number = self.number + 1;
        (number <= ATTEMPTS).then_some(Self {
            number,
            took_before: took,
        })
    }

    /// How far ahead it is to begin: the work may take as long as before.
    pub(super) fn lead(self, usual: Duration) -> Duration {
        match self.number {
            1 => usual,
            _ => lead_of_the_same_work(usual, self.took_before),
        }
    }
}

/// A motion that was handed over for publication before its plan was complete.
pub(super) struct EarlyExecution {
    pub(super) candidate: Candidate,
    pub(super) published: Result<u32, ExecutionRefusal>,
}

/// Time before a deadline of `whole` at which planning of so many candidates ends.
fn delivery_margin(candidates: usize, whole: Duration) -> Duration {
    let of_candidates = DELIVERY_MARGIN_PER_CANDIDATE.mul_f64(candidates as f64);
    (DELIVERY_MARGIN + of_candidates).min(whole / 2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::task;
    use shared_types::message::PlanRequest;

    #[test]
    fn appended_goals_are_excused_for_their_wait_and_others_wait_no_longer_than_their_deadline() {
        let ms = Duration::from_millis;
        let received = Instant::now();
        let queued = |appends: bool, deadline: Duration| Queued {
            asker: Asker::GoalKeeper(Box::new(PlanRequest::ZEROED)),
            task: PlanTask {
                appends,
                deadline,
                ..task()
            },
            received,
        };
        let short = queued(false, ms(20));
        assert_eq!(short.deadline(ms(300)), short.expires());
        assert!(short.can_wait(received + ms(15)) && !short.can_wait(received + ms(20)));
        let patient = queued(false, ms(1_000));
        assert!(patient.can_wait(received + ms(99)) && !patient.can_wait(received + ms(100)));
        let appended = queued(true, ms(20));
        assert_eq!(appended.deadline(ms(300)), short.expires() + ms(300));
        assert_eq!(appended.expires(), short.expires() + ms(600));
        assert!(appended.can_wait(received + ms(599)) && !appended.can_wait(received + ms(600)));
    }

    #[test]
    fn work_ends_sooner_before_a_deadline_of_many_candidates_and_halfway_to_a_short_one() {
        let us = Duration::from_micros;
        assert_eq!(delivery_margin(1, us(20_000)), us(520));
        assert_eq!(delivery_margin(64, us(20_000)), us(1_780));
        assert_eq!(delivery_margin(64, us(2_000)), us(1_000));
        assert_eq!(delivery_margin(1, Duration::MAX), us(520));
        assert_eq!(delivery_margin(1, Duration::ZERO), Duration::ZERO);
    }
}
