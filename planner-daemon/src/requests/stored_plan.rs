//! The plan by which the planner `null` answers.

use std::sync::{Arc, OnceLock};

use planning::{Candidate, Plan, Request, StageTimes};
use trajectory::{Knot, Trajectory};

use super::planned::Planned;

/// The first whole plan, which answers all later requests.
#[derive(Clone, Default)]
pub(super) struct StoredPlan(Arc<OnceLock<Plan>>);

impl StoredPlan {
    /// The stored plan, at once, with no more candidates than the request wants; until there is one, the plan that is made, which is stored
    /// with as many knots of each motion as the request allows.
    pub(super) fn get_or_store(
        &self,
        request: &Request,
        plan: impl FnOnce() -> Planned,
    ) -> Planned {
        if let Some(stored) = self.0.get() {
            let mut plan = stored.clone();
            plan.candidates.truncate(request.candidates);
            return Ok(plan);
        }
        let first = plan()?;
        if !first.truncated && !first.candidates.is_empty() {
            self.0.get_or_init(|| padded(&first, request.knots));
        }
        Ok(first)
    }
}

/// What an answer is made from: candidates, as large as they can be, without what they were chosen from and how long that took.
fn padded(plan: &Plan, knots: usize) -> Plan {
    let candidates = plan.candidates.iter().map(|candidate| Candidate {
        trajectory: Arc::new(with_knots(&candidate.trajectory, knots)),
        ..candidate.clone()
    });
    Plan {
        draws: Vec::new(),
        candidates: candidates.collect(),
        stages: StageTimes::default(),
        ..plan.clone()
    }
}

/// The same motion with so many knots, where it has fewer: the middle of its longest piece becomes one, again and again.
fn with_knots(motion: &Trajectory, count: usize) -> Trajectory {
    let mut knots = motion.knots().to_vec();
    while knots.len() < count {
        let lasts_s = |index: &usize| knots[index + 1].time - knots[*index].time;
        let longest = (0..knots.len() - 1).max_by(|a, b| lasts_s(a).total_cmp(&lasts_s(b)));
        let Some(longest) = longest else { break };
        let time = 0.5 * (knots[longest].time + knots[longest + 1].time);
        knots.insert(longest + 1, Knot::of(time, &motion.at(time)));
    }
    Trajectory::new(knots).expect("times rise as before")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{request, straight_problem, unit_robot};
    use planning::{Models, Planner};

    #[test]
    fn the_first_whole_plan_answers_all_requests() {
        let planner = Planner::new(unit_robot(), Models::default(), 1).unwrap();
        let problem = straight_problem();
        let planned = |is_interrupted: bool| {
            let plan = planner.plan(&problem, &request(), &|| is_interrupted);
            plan.map_err(Into::into)
        };
        let (stored, asked) = (
            StoredPlan::default(),
            Request {
                knots: 64,
                ..request()
            },
        );
        assert!(
            stored
                .get_or_store(&asked, || planned(true))
                .unwrap()
                .truncated
        );
        let first = stored.get_or_store(&asked, || planned(false)).unwrap();
        let again = stored
            .get_or_store(&asked, || panic!("nothing is planned"))
            .unwrap();
        for (first, again) in first.candidates.iter().zip(&again.candidates) {
            let [first, again] = [first, again].map(|it| &it.trajectory);
            assert_eq!(again.knots().len(), 64);
            for part in 0..100 {
                let time = first.duration() * f64::from(part) / 100.0;
                let apart = first.at(time).position - again.at(time).position;
                assert!(apart.norm() < 1e-12);
            }
        }
        assert_eq!(again.candidates.len(), first.candidates.len());
    }
}
