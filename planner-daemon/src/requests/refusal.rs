//! A request that is answered without planning.

use shared_types::codes::{Outcome, PlanField};
use shared_types::valid;

/// A request that is answered without planning.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Refusal {
    pub(crate) outcome: Outcome,
    pub(crate) field: PlanField,
    pub(crate) reason: String,
}

impl Refusal {
    /// A refusal that is not about one field.
    pub(crate) fn new(outcome: Outcome, reason: impl Into<String>) -> Self {
        Self {
            outcome,
            field: PlanField::None,
            reason: reason.into(),
        }
    }

    pub(crate) fn field(field: PlanField, reason: impl Into<String>) -> Self {
        Self {
            outcome: Outcome::InvalidRequest,
            field,
            reason: reason.into(),
        }
    }
}

/// Refuses what is asked, a request or a goal, for another robot than this daemon's.
pub(super) fn check_robot(asked: &str, stated: Option<u64>, own: u64) -> Result<(), Refusal> {
    let Some(stated) = stated.filter(|stated| *stated != own) else {
        return Ok(());
    };
    let reason = format!(
        "the {asked} is for robot {stated:016x}, this daemon plans for robot {own:016x}: their robot files differ"
    );
    Err(Refusal::new(Outcome::WrongRobot, reason))
}

impl From<valid::Invalid> for Refusal {
    fn from(invalid: valid::Invalid) -> Self {
        Self {
            outcome: invalid.outcome(),
            field: invalid.plan_field(),
            reason: invalid.to_string(),
        }
    }
}
