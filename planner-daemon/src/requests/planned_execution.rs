//! The execution of a candidate of an earlier plan, which was looked at meanwhile.

use std::sync::Arc;

use shared_types::clock::mono_now_ns;
use shared_types::ipc::PlanActiveRequest;
use shared_types::valid::PlannedExecution;

use super::answer::Answer;
use super::asker::is_open;
use super::motion_turn::timed_goals;
use super::recent_plans::KeptPlan;
use super::request_validator::check_requested;
use super::service::Service;
use crate::execution::{ExecutionRefusal, ExecutionTiming, SelectedMotion};

impl Service {
    /// Publishes a candidate of an earlier plan if it still fits, and answers with it.
    pub(super) fn execute_planned(&mut self, active: &PlanActiveRequest, asked: &PlannedExecution) {
        if !is_open(active) {
            return;
        }
        let named = self
            .validator
            .check_executes()
            .and_then(|()| check_requested(asked.requested_mono_ns, mono_now_ns()))
            .and_then(|()| self.plans.candidate(&asked.plan));
        let (plan, index) = match named {
            Ok(named) => named,
            Err(refusal) => {
                let mut answer = Answer::refused(asked.request_id, &refusal);
                return self.send_to_client(&mut answer, active);
            }
        };
        let mut answer = Answer::of_kept(asked.request_id, plan, index);
        let published = self.publish_planned(plan, index, asked);
        if let Ok(id) = published {
            self.goal.keeper.end_for_foreign(id);
        }
        answer.report_execution(published.map_err(|refusal| advice(&refusal)));
        self.send_to_client(&mut answer, active);
    }

    fn publish_planned(
        &self,
        plan: &KeptPlan,
        index: usize,
        asked: &PlannedExecution,
    ) -> Result<u32, ExecutionRefusal> {
        if self.ends {
            return Err(ExecutionRefusal::DaemonEnds);
        }
        let (leaves, planned_mono_ns) = plan.begin.to_execute()?;
        let candidate = &plan.candidates[index];
        self.execution.publish(SelectedMotion {
            motion: Arc::clone(&candidate.trajectory),
            goals: timed_goals(&plan.goals, candidate),
            leaves,
            draw: candidate.draw,
            plan_id: plan.plan_id,
            is_replanned: false,
            timing: ExecutionTiming {
                requested_mono_ns: asked.requested_mono_ns,
                begin_mono_ns: asked.begin_mono_ns.max(planned_mono_ns),
            },
        })
    }
}

/// Why a candidate is not executed, and what to do where the robot or its surroundings have gone on since it was planned.
fn advice(refusal: &ExecutionRefusal) -> String {
    match refusal {
        ExecutionRefusal::SwitchMissed { .. }
        | ExecutionRefusal::NotFollowed { .. }
        | ExecutionRefusal::StartsElsewhere { .. } => {
            format!("{refusal}; plan again from where the robot is")
        }
        ExecutionRefusal::SceneInTheWay(_) => format!("{refusal}; plan again"),
        _ => refusal.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::live_scene::InTheWay;
    use shared_types::capacity::REASON_BYTES;

    #[test]
    fn what_is_out_of_date_says_so_and_what_to_do_within_an_answers_text() {
        let id = u32::MAX;
        for (refusal, text) in [
            (ExecutionRefusal::NotFollowed { id }, "is not followed"),
            (
                ExecutionRefusal::SwitchMissed {
                    id,
                    ahead_s: -1234.5,
                },
                "switch missed",
            ),
            (
                ExecutionRefusal::SwitchMissed {
                    id,
                    ahead_s: 0.0012,
                },
                "switch missed",
            ),
            (
                ExecutionRefusal::StartsElsewhere { distance_rad: 1.0 },
                "away from the commanded configuration",
            ),
            (InTheWay::OnTheWay { at_s: 1.0 }.into(), "in the way"),
            (InTheWay::AtTheEnd.into(), "where it ends"),
        ] {
            let advice = advice(&refusal);
            assert!(
                advice.contains(text) && advice.contains("plan again"),
                "{advice}"
            );
            assert!(advice.len() <= REASON_BYTES, "{advice}");
        }
        let busy = advice(&ExecutionRefusal::Busy { id });
        assert!(!busy.contains("plan again"), "{busy}");
    }
}
