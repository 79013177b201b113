//! The last plans, from which a request can go on.

use std::collections::VecDeque;

use planning::{Candidate, PreviousPlan, WAYPOINTS};
use shared_types::capacity::RECENT_PLANS;
use shared_types::codes::PlanField;
use shared_types::valid;

use super::refusal::Refusal;

/// The last [`RECENT_PLANS`] plans that had candidates, by their ids.
#[derive(Debug, Default)]
pub(crate) struct RecentPlans {
    plans: VecDeque<(u64, PreviousPlan)>,
}

impl RecentPlans {
    /// Keeps what was delivered under an id, and lets go of the oldest plan if there are too many.
    pub(crate) fn keep(&mut self, plan_id: u64, candidates: &[Candidate], selected: Option<usize>) {
        if candidates.is_empty() {
            return;
        }
        if self.plans.len() == RECENT_PLANS {
            self.plans.pop_front();
        }
        let paths = candidates.iter().map(|c| c.trajectory.sample(WAYPOINTS));
        let plan = PreviousPlan {
            paths: paths.collect(),
            followed: selected,
        };
        self.plans.push_back((plan_id, plan));
    }

    /// The plan that a request names, with the motion that is followed.
    pub(crate) fn find(&self, named: &valid::PreviousPlan) -> Result<PreviousPlan, Refusal> {
        let known = self.plans.iter().find(|(id, _)| *id == named.plan_id);
        let Some((id, plan)) = known else {
            let reason = format!(
                "previous_plan_id {} is none of the last {RECENT_PLANS} plans with candidates",
                named.plan_id
            );
            return Err(Refusal::field(PlanField::PreviousPlan, reason));
        };
        let count = plan.paths.len();
        match named.candidate {
            Some(index) if index >= count => {
                let reason = format!(
                    "previous_candidate is {index}; plan {id} has 0..={}",
                    count - 1
                );
                Err(Refusal::field(PlanField::PreviousCandidate, reason))
            }
            candidate => Ok(PreviousPlan {
                paths: plan.paths.clone(),
                followed: candidate.or(plan.followed),
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::candidate;

    fn named(plan_id: u64, candidate: Option<usize>) -> valid::PreviousPlan {
        valid::PreviousPlan { plan_id, candidate }
    }

    #[test]
    fn the_last_plans_are_found_with_the_motion_that_is_followed() {
        let mut plans = RecentPlans::default();
        for id in 1..=RECENT_PLANS as u64 + 1 {
            plans.keep(id, &[candidate(), candidate()], Some(1));
        }
        assert_eq!(plans.find(&named(2, None)).unwrap().followed, Some(1));
        assert_eq!(plans.find(&named(2, Some(0))).unwrap().followed, Some(0));
        let gone = plans.find(&named(1, None)).unwrap_err();
        assert_eq!(gone.field, PlanField::PreviousPlan);
        let beyond = plans.find(&named(2, Some(2))).unwrap_err();
        assert_eq!(beyond.field, PlanField::PreviousCandidate);
        assert!(beyond.reason.contains("0..=1"), "{}", beyond.reason);
    }

    #[test]
    fn a_plan_without_candidates_takes_no_place() {
        let mut plans = RecentPlans::default();
        plans.keep(1, &[], None);
        assert!(plans.find(&named(1, None)).is_err());
    }
}
