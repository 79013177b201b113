//! What an answer says of its plan: the outcome, and why there are no more candidates.

use pcc_model::UnitRobot;
use planning::{Candidate, Failure, Plan, PlannerError, Source};
use shared_types::codes::Outcome;

use super::planned::PlanError;
use super::refusal::Refusal;
use super::report;
use super::request_validator::PlanTask;

/// Outcome and explanation of a plan of which these candidates are delivered, and so many certified ones are not.
pub(super) fn verdict(
    task: &PlanTask,
    plan: &Plan,
    delivered: &[Candidate],
    undeliverable: usize,
) -> (Outcome, String) {
    let (wanted, count) = (task.request.candidates, delivered.len());
    let failed = failures(plan, delivered, undeliverable);
    if plan.truncated {
        let reason = format!(
            "{count} of {wanted} candidates were certified within {} ms",
            task.deadline.as_secs_f64() * 1e3
        );
        (Outcome::Truncated, reason)
    } else if count == 0 {
        let drawn = plan.draws.len() + plan.explored;
        let reason = format!("none of {drawn} paths was certified: {failed}");
        (Outcome::NoPath, reason)
    } else if count < wanted {
        let reason = format!("{count} of {wanted} candidates: {failed}");
        (Outcome::Ok, reason)
    } else {
        (Outcome::Ok, String::new())
    }
}

/// The number of draws for each cause of failure, as text.
fn failures(plan: &Plan, delivered: &[Candidate], undeliverable: usize) -> String {
    let causes = [
        (Failure::NoPath, "without a path"),
        (Failure::Goal, "short of the goal"),
        (Failure::Collision, "not certified free"),
        (Failure::Bending, "bent too far"),
        (Failure::Time, "without time parameterization"),
        (Failure::Slower, "slower than others"),
        (Failure::Truncated, "truncated"),
    ];
    let count = |failure| {
        let draws = plan.draws.iter();
        draws
            .filter(|draw| draw.outcome.as_ref().err() == Some(&failure))
            .count()
    };
    let mut counts: Vec<(usize, &str)> =
        causes.map(|(failure, text)| (count(failure), text)).into();
    counts.push((
        undeliverable,
        "off the goal, too long or with too many knots",
    ));
    let parts = counts.iter().filter(|(count, _)| *count > 0);
    let parts: Vec<String> = parts
        .map(|(count, text)| format!("{count} {text}"))
        .collect();
    let mut sources = delivered.iter().map(|candidate| candidate.source);
    if !parts.is_empty() {
        parts.join(", ")
    } else if sources.any(|source| source == Source::MovedEnd) {
        "the end of the motion under way is moved".to_owned()
    } else {
        "no more goal configurations".to_owned()
    }
}

/// The refusal of a request that was not planned.
pub(super) fn fault_refusal(fault: &PlanError, task: &PlanTask, robot: &UnitRobot) -> Refusal {
    let outcome = match fault {
        PlanError::Planner(PlannerError::Infeasible(infeasible)) => {
            return report::infeasible(infeasible, &task.problem.goal, robot);
        }
        PlanError::Planner(PlannerError::InfeasibleVia { index, infeasible }) => {
            let goals = task.goals();
            let refusal = report::infeasible(infeasible, &goals[*index].goal, robot);
            let reason = format!("{} (goal {} of {})", refusal.reason, index + 1, goals.len());
            return Refusal { reason, ..refusal };
        }
        PlanError::Planner(PlannerError::ModelNotLoaded(_)) => Outcome::SamplerNotLoaded,
        PlanError::Planner(_) | PlanError::Panic(_) => Outcome::NoPath,
    };
    Refusal::new(outcome, fault.to_string())
}
