//! The answer to a plan request: report and candidates' knots, written into the shared memory that the client reads.

use std::mem::{self, MaybeUninit};
use std::slice;
use std::time::{Duration, Instant};

use iceoryx2::port::{LoanError, SendError};
use pcc_model::{BitHash, Configuration, UnitRobot};
use planning::{Candidate, Plan, Source, select};
use shared_types::PROTOCOL_VERSION;
use shared_types::codes::{Outcome, PlanDependence, Stage};
use shared_types::ipc::PlanActiveRequest;
use shared_types::message::{CandidateSummary, Knot, NONE_SELECTED, PlanReport, ReasonText};
use shared_types::valid::{MAX_DURATION_S, SelectionRule};

use super::planned::{PlanError, Planned};
use super::recent_plans::{KeptPlan, PlanBegin};
use super::refusal::Refusal;
use super::report;
use super::request_validator::PlanTask;
use super::verdict::{fault_refusal, verdict};
use crate::identity::Identity;
use crate::knots;

/// One answer, complete but for its time of writing and the hash.
pub(crate) struct Answer {
    pub(super) report: PlanReport,
    /// The candidates that are delivered.
    pub(super) candidates: Vec<Candidate>,
    /// What the plan depends on beside its request.
    pub(super) depends_on: PlanDependence,
    /// Where it begins.
    pub(super) start: Configuration,
}

/// Why an answer did not reach its client.
#[derive(Debug, thiserror::Error)]
pub(crate) enum AnswerError {
    /// There is no shared memory for the answer.
    #[error("no shared memory for the answer: {0:?}")]
    Loan(LoanError),
    /// The answer was written but not delivered.
    #[error("the answer was not delivered: {0:?}")]
    Send(SendError),
}

impl Answer {
    /// An answer without candidates.
    pub(crate) fn refused(request_id: u64, refusal: &Refusal) -> Self {
        let mut report = PlanReport {
            protocol_version: PROTOCOL_VERSION,
            outcome: refusal.outcome.code(),
            request_id,
            selected: NONE_SELECTED,
            invalid_field: refusal.field.code(),
            ..PlanReport::ZEROED
        };
        report.reason = ReasonText::new(&refusal.reason);
        Self {
            report,
            candidates: Vec::new(),
            depends_on: PlanDependence::NotPlanned,
            start: Configuration::zeros(),
        }
    }

    /// Sets which robot is planned for, and by which weights.
    pub(crate) fn set_identity(&mut self, identity: Identity) {
        self.report.robot_hash = identity.robot_hash;
        self.report.weights_hash = identity.weights_hash;
    }

    /// The answer to a plan, or to the reason why there is none; lengths in metres.
    ///
    /// The plan's candidates are taken. The rest of it is large: free its memory once the answer is sent.
    pub(crate) fn of_plan(task: &PlanTask, planned: &mut Planned, robot: &UnitRobot) -> Self {
        match planned {
            Ok(plan) => Self::certified(task, plan, robot),
            Err(fault) => {
                let refusal = fault_refusal(fault, task, robot);
                Self::refused(task.request_id, &refusal)
            }
        }
    }

    /// An answer with the candidates that certified first.
    pub(crate) fn early(task: &PlanTask, candidates: Vec<Candidate>, robot: &UnitRobot) -> Self {
        let reason = format!(
            "{} of {} candidates so far; the whole answer follows",
            candidates.len(),
            task.request.candidates
        );
        let refusal = Refusal::new(Outcome::Early, reason);
        let mut answer = Self::refused(task.request_id, &refusal);
        let errors = tip_errors(task, &candidates, robot);
        answer.candidates = candidates;
        answer.summarise(task, robot, &errors);
        answer
    }

    /// An answer with the candidate that was handed over for publication before its plan failed.
    pub(super) fn broken_off(
        task: &PlanTask,
        handed_over: &Candidate,
        fault: &PlanError,
        robot: &UnitRobot,
    ) -> Self {
        let reason = format!("1 of {} candidates: {fault}", task.request.candidates);
        let refusal = Refusal::new(Outcome::Ok, reason);
        let mut answer = Self::refused(task.request_id, &refusal);
        answer.candidates = vec![handed_over.clone()];
        let errors = tip_errors(task, &answer.candidates, robot);
        answer.summarise(task, robot, &errors);
        answer
    }

    /// An answer with one candidate of an earlier plan, which is selected.
    pub(super) fn of_kept(request_id: u64, plan: &KeptPlan, index: usize) -> Self {
        let mut answer = Self::refused(request_id, &Refusal::new(Outcome::Ok, ""));
        answer.candidates = vec![plan.candidates[index].clone()];
        answer.report.selected = 0;
        answer.report.candidate_count = 1;
        answer.report.candidates[0] = CandidateSummary {
            first_knot: 0,
            ..plan.summaries[index]
        };
        answer.report.classical_certified = answer.not_learned();
        answer.set_plan(plan.plan_id, &plan.begin, Duration::ZERO);
        answer
    }

    fn certified(task: &PlanTask, plan: &mut Plan, robot: &UnitRobot) -> Self {
        let mut candidates = mem::take(&mut plan.candidates);
        let count = candidates.len();
        let mut of_all = tip_errors(task, &candidates, robot).into_iter();
        let mut errors = Vec::with_capacity(count);
        candidates.retain(|candidate| {
            let error = of_all.next();
            let fits = error.filter(|error| is_in_bounds(task, candidate, *error));
            errors.extend(fits);
            fits.is_some()
        });
        let (outcome, reason) = verdict(task, plan, &candidates, count - candidates.len());
        let mut answer = Self::refused(task.request_id, &Refusal::new(outcome, reason));
        let report = &mut answer.report;
        report.learned_drawn = plan.learned_drawn as u32;
        report.learned_certified = plan.learned_certified as u32;
        for &stage in Stage::ALL {
            report.stages_ns[stage.code() as usize] = (plan.stages[stage] * 1e9) as u64;
        }
        answer.candidates = candidates;
        answer.summarise(task, robot, &errors);
        answer
    }

    /// Selects among the candidates, of which these are the tip errors, and fills in their part of the report.
    fn summarise(&mut self, task: &PlanTask, robot: &UnitRobot, tip_errors: &[f64]) {
        let selected = match task.selection {
            SelectionRule::Index(index) => (index < self.candidates.len()).then_some(index),
            SelectionRule::Best(rule) => select(&self.candidates, &task.problem.start, rule),
        };
        self.report.selected = selected.map_or(NONE_SELECTED, |index| index as u32);
        self.report.candidate_count = self.candidates.len() as u32;
        let candidates = self.candidates.iter().zip(tip_errors);
        let mut first = 0;
        for (summary, (candidate, error)) in self.report.candidates.iter_mut().zip(candidates) {
            *summary = report::summary(candidate, first, *error, robot);
            first += candidate.trajectory.knots().len();
        }
        self.report.classical_certified = self.not_learned();
    }

    /// Number of candidates that are not the learned sampler's.
    fn not_learned(&self) -> u32 {
        let learned =
            |candidate: &&Candidate| matches!(candidate.source, Source::Learned | Source::Explored);
        let learned = self.candidates.iter().filter(learned).count();
        (self.candidates.len() - learned) as u32
    }

    /// Explains why it has fewer candidates than were asked for where its plan was broken off for another request.
    pub(super) fn tell_that_it_made_way(&mut self) {
        if self.outcome() == Some(Outcome::Truncated) {
            let reason = "a request came for which its motion, which is on its way, is left: no more candidates were planned";
            self.report.reason = ReasonText::new(reason);
        }
    }

    /// The selected candidate and its index.
    pub(crate) fn selected(&self) -> Option<(usize, &Candidate)> {
        let index = self.report.selected as usize;
        Some((index, self.candidates.get(index)?))
    }

    /// Selects the motion of a draw, which is executed already.
    pub(super) fn select_draw(&mut self, draw: usize) {
        let of_draw = self.candidates.iter().position(|it| it.draw == draw);
        self.report.selected = of_draw.map_or(NONE_SELECTED, |index| index as u32);
    }

    /// What became of the request.
    pub(crate) fn outcome(&self) -> Option<Outcome> {
        Outcome::try_from(self.report.outcome).ok()
    }

    /// Sets the id of the plan, how its candidates begin, and how long its request waited in the queue.
    pub(crate) fn set_plan(&mut self, plan_id: u64, begin: &PlanBegin, wait: Duration) {
        self.report.plan_id = plan_id;
        self.report.start = begin.motion_start().code();
        self.set_wait(wait);
    }

    /// Sets where the plan begins, and what it depends on beside its request: on its deadline, too, where that has cut it short.
    pub(super) fn set_dependence(&mut self, depends_on: PlanDependence, start: Configuration) {
        let is_cut_short = self.outcome() == Some(Outcome::Truncated);
        let by_deadline = is_cut_short && depends_on == PlanDependence::Nothing;
        self.depends_on = if by_deadline {
            PlanDependence::Deadline
        } else {
            depends_on
        };
        self.start = start;
    }

    /// Sets how long its request waited in the queue.
    pub(crate) fn set_wait(&mut self, wait: Duration) {
        self.report.stages_ns[Stage::Wait.code() as usize] = nanoseconds(wait);
    }

    /// States under which id the selected motion was published, or why it was not.
    pub(super) fn report_execution(&mut self, published: Result<u32, String>) {
        let plan_id = self.report.plan_id;
        match published {
            Ok(id) => {
                tracing::info!("trajectory {id} of plan {plan_id} is published for execution");
                self.report.trajectory_id = id;
            }
            Err(reason) => {
                tracing::info!("plan {plan_id} is not executed: {reason}");
                self.report.outcome = Outcome::ExecutionRefused.code();
                self.report.reason = ReasonText::new(&reason);
            }
        }
    }

    /// Sets the hash of all candidates' knots.
    pub(super) fn set_hash(&mut self) {
        let mut hash = BitHash::new();
        for candidate in &self.candidates {
            hash.add(candidate.trajectory.knot_hash());
        }
        self.report.plan_hash = hash.value();
    }

    /// Writes the answer into shared memory and sends it.
    pub(crate) fn send(&mut self, request: &PlanActiveRequest) -> Result<(), AnswerError> {
        let clock = Instant::now();
        let motions = || self.candidates.iter().map(|it| it.trajectory.knots());
        let count = motions().map(<[_]>::len).sum();
        let mut response = request
            .loan_slice_uninit(count)
            .map_err(AnswerError::Loan)?;
        let mut free = response.payload_mut();
        for knots in motions() {
            let (place, rest) = free.split_at_mut(knots.len());
            copy_knots(place, knots::to_wire(knots));
            free = rest;
        }
        debug_assert!(free.is_empty(), "as many knots as were loaned");
        // SAFETY: its knots are as many as were loaned, and each is written.
        #[allow(unsafe_code)]
        let mut response = unsafe { response.assume_init() };
        self.set_hash();
        self.report.stages_ns[Stage::Write.code() as usize] = nanoseconds(clock.elapsed());
        *response.user_header_mut() = self.report;
        response.send().map_err(AnswerError::Send)
    }
}

/// Copies knots to a place of as many at once, which writes whole cache lines without first fetching those that the client's processor still
/// holds.
fn copy_knots(place: &mut [MaybeUninit<Knot>], knots: &[Knot]) {
    assert_eq!(place.len(), knots.len());
    // SAFETY: `&mut` and `&` cannot overlap, and both are as long, of the same type.
    #[allow(unsafe_code)]
    unsafe {
        place
            .as_mut_ptr()
            .copy_from_nonoverlapping(knots.as_ptr().cast(), knots.len());
    }
}

fn nanoseconds(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}

/// Whether a candidate reaches the goal as closely as the client wants and fits the message and its share of the answer.
pub(crate) fn is_deliverable(task: &PlanTask, candidate: &Candidate, robot: &UnitRobot) -> bool {
    // As it is computed for the whole answer, to the bit.
    let errors = tip_errors(task, slice::from_ref(candidate), robot);
    errors
        .iter()
        .all(|error| is_in_bounds(task, candidate, *error))
}

/// Distances of the candidates' final tips to the goal's, in sections.
fn tip_errors(task: &PlanTask, candidates: &[Candidate], robot: &UnitRobot) -> Vec<f64> {
    let goal_tip = task.problem.goal_tip(robot);
    let ends: Vec<Configuration> = candidates.iter().map(Candidate::end).collect();
    let tips = robot.tips(&ends);
    tips.iter().map(|tip| (tip - goal_tip).norm()).collect()
}

fn is_in_bounds(task: &PlanTask, candidate: &Candidate, tip_error: f64) -> bool {
    tip_error <= task.tip_tolerance
        && candidate.trajectory.knots().len() <= task.most_knots(candidate)
        && candidate.trajectory.duration() <= MAX_DURATION_S
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{task, unit_robot};
    use planning::{Models, Planner, PlannerError};

    fn plan(task: &PlanTask, interrupted: bool) -> Plan {
        let planner = Planner::new(unit_robot(), Models::default(), 1).unwrap();
        let interrupt = || interrupted;
        planner
            .plan(&task.problem, &task.request, &interrupt)
            .unwrap()
    }

    fn answer(task: &PlanTask, plan: Plan) -> Answer {
        Answer::of_plan(task, &mut Ok(plan), &unit_robot())
    }

    #[test]
    fn a_whole_plan_is_ok_and_its_candidate_selected() {
        let task = task();
        let answer = answer(&task, plan(&task, false));
        assert_eq!(answer.outcome(), Some(Outcome::Ok));
        assert_eq!(answer.report.reason.text(), "");
        let (index, candidate) = answer.selected().unwrap();
        assert_eq!(index, 0);
        let knots = candidate.trajectory.knots().len();
        assert_eq!(answer.report.candidates[0].knot_count as usize, knots);
        assert_eq!(answer.report.classical_certified, 1);
        assert!(answer.report.candidates[0].tip_error_m < 1e-6);
    }

    #[test]
    fn a_truncated_plan_says_so_and_has_nothing_selected() {
        let task = task();
        let answer = answer(&task, plan(&task, true));
        assert_eq!(answer.outcome(), Some(Outcome::Truncated));
        assert!(
            answer.report.reason.text().contains("0 of 1")
                && answer.report.reason.text().contains("20 ms"),
            "{}",
            answer.report.reason.text()
        );
        assert!(answer.selected().is_none());
        assert_eq!(answer.report.selected, NONE_SELECTED);
    }

    #[test]
    fn a_motion_longer_than_the_message_allows_is_not_delivered() {
        for (scale, outcome) in [(1e-4, Outcome::Ok), (1e-20, Outcome::NoPath)] {
            let mut task = task();
            task.request.limits_scale = scale;
            let answer = answer(&task, plan(&task, false));
            assert_eq!(
                answer.outcome(),
                Some(outcome),
                "{}",
                answer.report.reason.text()
            );
        }
    }

    #[test]
    fn candidates_off_the_goal_or_with_too_many_knots_are_not_delivered() {
        let (mut precise, mut short) = (task(), task());
        let plan = plan(&precise, false);
        precise.tip_tolerance = -1.0;
        short.request.knots = 2;
        assert!(plan.candidates[0].trajectory.knots().len() > 2);
        for task in [precise, short] {
            let answer = answer(&task, plan.clone());
            assert_eq!(answer.outcome(), Some(Outcome::NoPath));
            assert_eq!(
                (answer.candidates.len(), answer.selected().is_some()),
                (0, false)
            );
            assert!(
                answer.report.reason.text().contains("1 off the goal"),
                "{}",
                answer.report.reason.text()
            );
        }
    }

    #[test]
    fn a_motion_whose_end_is_moved_may_have_more_knots_than_others() {
        let mut task = task();
        let mut plan = plan(&task, false);
        let knots = plan.candidates[0].trajectory.knots().len();
        task.request.knots = knots - 1;
        plan.candidates[0].source = Source::MovedEnd;
        task.request.candidates = 4;
        for (end_moved, outcome, reason) in [
            (
                knots,
                Outcome::Ok,
                "1 of 4 candidates: the end of the motion",
            ),
            (knots - 1, Outcome::NoPath, "too many knots"),
        ] {
            task.knots.end_moved = end_moved;
            let answer = answer(&task, plan.clone());
            assert_eq!(answer.outcome(), Some(outcome));
            let told = answer.report.reason.text();
            assert!(told.contains(reason), "{told}");
        }
    }

    #[test]
    fn an_index_beyond_the_candidates_selects_nothing() {
        let mut task = task();
        task.selection = SelectionRule::Index(1);
        let answer = answer(&task, plan(&task, false));
        assert_eq!(
            (answer.candidates.len(), answer.selected().is_some()),
            (1, false)
        );
    }

    #[test]
    fn each_fault_has_its_outcome() {
        let straight = planning::Infeasible::StartInCollision { clearance: -0.1 };
        for (fault, outcome) in [
            (
                PlanError::Planner(PlannerError::Infeasible(straight)),
                Outcome::StartInCollision,
            ),
            (
                PlanError::Planner(PlannerError::ModelNotLoaded("fast")),
                Outcome::SamplerNotLoaded,
            ),
            (PlanError::Panic("defect".to_owned()), Outcome::NoPath),
        ] {
            let answer = Answer::of_plan(&task(), &mut Err(fault), &unit_robot());
            assert_eq!(answer.outcome(), Some(outcome));
            assert!(!answer.report.reason.text().is_empty());
        }
    }

    #[test]
    fn what_happens_to_the_execution_is_stated() {
        let task = task();
        let mut answer = answer(&task, plan(&task, false));
        answer.report_execution(Err("no controller".to_owned()));
        assert_eq!(answer.outcome(), Some(Outcome::ExecutionRefused));
        assert_eq!(answer.report.reason.text(), "no controller");
        assert!(answer.outcome().unwrap().has_candidates());
    }
}
