//! The last plans, from which a request can go on, and whose candidates can be executed.

use std::collections::VecDeque;

use pcc_model::Configuration;
use planning::{Candidate, PreviousPlan, Via, WAYPOINTS};
use shared_types::capacity::RECENT_PLANS;
use shared_types::codes::{MotionStart, PlanField};
use shared_types::message::CandidateSummary;
use shared_types::valid;

use super::refusal::Refusal;
use crate::execution::{ExecutionRefusal, Switch};

/// How the candidates of a plan begin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum PlanBegin {
    /// At rest.
    AtRest {
        /// The earliest begin, nanoseconds of `CLOCK_MONOTONIC`; none: as soon as possible.
        not_before_mono_ns: Option<i64>,
    },
    /// Where they leave the motion that was followed when they were planned.
    AtSwitch(Switch),
    /// In motion, in a state that the request stated.
    InGivenMotion,
}

impl PlanBegin {
    /// Where a motion of the plan leaves the one that is followed, and its earliest begin (nanoseconds of `CLOCK_MONOTONIC`) where it begins at
    /// rest.
    ///
    /// # Errors
    /// [`ExecutionRefusal::BeginsInGivenMotion`].
    pub(super) fn to_execute(self) -> Result<(Option<Switch>, Option<i64>), ExecutionRefusal> {
        match self {
            Self::AtRest { not_before_mono_ns } => Ok((None, not_before_mono_ns)),
            Self::AtSwitch(switch) => Ok((Some(switch), None)),
            Self::InGivenMotion => Err(ExecutionRefusal::BeginsInGivenMotion),
        }
    }

    /// The configuration at the switch from the motion that is followed, where there is one.
    pub(super) fn start(&self) -> Option<Configuration> {
        match self {
            Self::AtSwitch(switch) => Some(switch.state.position),
            Self::AtRest { .. } | Self::InGivenMotion => None,
        }
    }

    /// How an answer tells it.
    pub(super) fn motion_start(&self) -> MotionStart {
        match self {
            Self::AtSwitch(_) => MotionStart::InMotion,
            Self::AtRest { .. } | Self::InGivenMotion => MotionStart::AtRest,
        }
    }
}

/// A plan as it was answered.
#[derive(Clone, Debug)]
pub(crate) struct KeptPlan {
    pub(crate) plan_id: u64,
    pub(crate) begin: PlanBegin,
    /// The goals, in their order.
    pub(crate) goals: Vec<Via>,
    /// Index of the candidate that was selected, if one was.
    pub(crate) selected: Option<usize>,
    pub(crate) candidates: Vec<Candidate>,
    /// Their figures in the answer, in the same order.
    pub(crate) summaries: Vec<CandidateSummary>,
}

/// The last [`RECENT_PLANS`] plans of clients that had candidates, and the last one whose motion to the goal that stays was published; at most one
/// older one of each until it is freed.
#[derive(Debug, Default)]
pub(crate) struct RecentPlans {
    plans: VecDeque<KeptPlan>,
    to_goal: VecDeque<KeptPlan>,
}

impl RecentPlans {
    /// Keeps what was delivered.
    pub(crate) fn keep(&mut self, plan: KeptPlan) {
        if !plan.candidates.is_empty() {
            self.plans.push_back(plan);
        }
    }

    /// Keeps a plan whose motion to the goal that stays was published. Such plans are many, and take no place of clients' plans.
    pub(crate) fn keep_to_goal(&mut self, plan: KeptPlan) {
        self.to_goal.push_back(plan);
    }

    /// Frees plans older than the last [`RECENT_PLANS`], or than the last one to the goal that stays; while the next plan is made that delays no answer.
    pub(crate) fn free_older(&mut self) {
        for (plans, most) in [(&mut self.plans, RECENT_PLANS), (&mut self.to_goal, 1)] {
            let older = plans.len().saturating_sub(most);
            plans.drain(..older);
        }
    }

    /// Whether a request can go on from a plan.
    pub(crate) fn has(&self, named: &valid::PreviousPlan) -> bool {
        self.find(named).is_ok()
    }

    /// The plan that a request goes on from, with the motion that is followed.
    pub(crate) fn previous(&self, named: &valid::PreviousPlan) -> Result<PreviousPlan, Refusal> {
        let plan = self.find(named)?;
        let motions = plan
            .candidates
            .iter()
            .map(|candidate| &candidate.trajectory);
        Ok(PreviousPlan {
            paths: motions.map(|motion| motion.sample(WAYPOINTS)).collect(),
            followed: named.candidate.or(plan.selected),
        })
    }

    /// The plan whose candidate a request has executed, and the candidate's index.
    pub(crate) fn candidate(
        &self,
        named: &valid::PreviousPlan,
    ) -> Result<(&KeptPlan, usize), Refusal> {
        let plan = self.find(named)?;
        let index = named.candidate.or(plan.selected).ok_or_else(|| {
            let (id, last) = (plan.plan_id, plan.candidates.len() - 1);
            let reason = format!("no candidate of plan {id} was selected; 0..={last} are allowed");
            Refusal::field(PlanField::PreviousCandidate, reason)
        })?;
        Ok((plan, index))
    }

    /// The plan that is named, which has the candidate if one is named, too.
    fn find(&self, named: &valid::PreviousPlan) -> Result<&KeptPlan, Refusal> {
        let id = named.plan_id;
        let last = self.plans.iter().rev().take(RECENT_PLANS);
        let mut last = last.chain(self.to_goal.back());
        let known = last.find(|plan| plan.plan_id == id);
        let known = known.ok_or_else(|| {
            let reason = format!(
                "previous_plan_id {id} is none of the last {RECENT_PLANS} plans of clients with candidates, nor the newest to the goal"
            );
            Refusal::field(PlanField::PreviousPlan, reason)
        })?;
        let count = known.candidates.len();
        if let Some(index) = named.candidate.filter(|index| *index >= count) {
            let last = count - 1;
            let reason = format!("previous_candidate is {index}; plan {id} has 0..={last}");
            return Err(Refusal::field(PlanField::PreviousCandidate, reason));
        }
        Ok(known)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::candidate;
    use std::sync::Arc;

    fn named(plan_id: u64, candidate: Option<usize>) -> valid::PreviousPlan {
        valid::PreviousPlan { plan_id, candidate }
    }

    fn plan(plan_id: u64, candidates: usize, selected: Option<usize>) -> KeptPlan {
        KeptPlan {
            plan_id,
            begin: PlanBegin::AtRest {
                not_before_mono_ns: None,
            },
            goals: Vec::new(),
            selected,
            candidates: vec![candidate(); candidates],
            summaries: vec![CandidateSummary::ZEROED; candidates],
        }
    }

    #[test]
    fn the_last_plans_are_found_with_the_motion_that_is_followed() {
        let mut plans = RecentPlans::default();
        for id in 1..=RECENT_PLANS as u64 + 1 {
            plans.keep(plan(id, 2, Some(1)));
        }
        let followed = |candidate| plans.previous(&named(2, candidate)).unwrap().followed;
        assert_eq!((followed(None), followed(Some(0))), (Some(1), Some(0)));
        let gone = plans.previous(&named(1, None)).unwrap_err();
        assert_eq!(gone.field, PlanField::PreviousPlan);
        plans.free_older();
        assert_eq!(plans.plans.len(), RECENT_PLANS);
        assert!(plans.has(&named(2, None)));
        let beyond = plans.previous(&named(2, Some(2))).unwrap_err();
        assert_eq!(beyond.field, PlanField::PreviousCandidate);
        assert!(beyond.reason.contains("0..=1"), "{}", beyond.reason);
    }

    #[test]
    fn a_candidate_is_executed_as_it_was_answered() {
        let mut plans = RecentPlans::default();
        let (chosen, open) = (plan(7, 2, Some(1)), plan(8, 2, None));
        let motion = Arc::clone(&chosen.candidates[1].trajectory);
        plans.keep(chosen);
        plans.keep(open);
        let index = |id, candidate| plans.candidate(&named(id, candidate)).unwrap().1;
        assert_eq!(
            (index(7, None), index(7, Some(0)), index(8, Some(1))),
            (1, 0, 1)
        );
        let (kept, index) = plans.candidate(&named(7, None)).unwrap();
        assert!(Arc::ptr_eq(&kept.candidates[index].trajectory, &motion));
        for (named, field, text) in [
            (
                named(9, None),
                PlanField::PreviousPlan,
                "none of the last 16",
            ),
            (named(7, Some(2)), PlanField::PreviousCandidate, "0..=1"),
            (named(8, None), PlanField::PreviousCandidate, "0..=1"),
        ] {
            let refusal = plans.candidate(&named).unwrap_err();
            assert_eq!(refusal.field, field);
            assert!(refusal.reason.contains(text), "{}", refusal.reason);
        }
    }

    #[test]
    fn plans_to_the_goal_that_stays_take_no_place_of_others() {
        let mut plans = RecentPlans::default();
        plans.keep(plan(1, 2, Some(0)));
        for id in 2..=2 * RECENT_PLANS as u64 {
            plans.keep_to_goal(plan(id, 2, Some(0)));
            plans.free_older();
        }
        let last = 2 * RECENT_PLANS as u64;
        assert!(plans.has(&named(1, None)) && plans.has(&named(last, None)));
        assert!(!plans.has(&named(last - 1, None)));
        assert_eq!(plans.to_goal.len(), 1);
    }

    #[test]
    fn a_plan_without_candidates_takes_no_place() {
        let mut plans = RecentPlans::default();
        plans.keep(plan(1, 0, None));
        assert!(plans.previous(&named(1, None)).is_err());
    }
}
