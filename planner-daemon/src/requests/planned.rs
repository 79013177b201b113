//! What planning gives: a plan, or why there is none; a panic is a reason like any other.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};

use planning::{Plan, PlannerError};

/// Why there is no plan.
#[derive(Debug, thiserror::Error)]
pub(crate) enum PlanError {
    /// The planner's own error.
    #[error(transparent)]
    Planner(#[from] PlannerError),
    /// A defect of the planner; the daemon goes on.
    #[error("internal error of the planner: {0}")]
    Panic(String),
}

pub(crate) type Planned = Result<Plan, PlanError>;

/// Runs a planner; a panic in it is an answer like any other.
pub(super) fn guarded(plan: impl FnOnce() -> Result<Plan, PlannerError>) -> Planned {
    match catch_unwind(AssertUnwindSafe(plan)) {
        Ok(result) => Ok(result?),
        Err(payload) => Err(PlanError::Panic(panic_text(payload.as_ref()))),
    }
}

fn panic_text(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<&str>().map(ToString::to_string);
    text.or_else(|| payload.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "panic without text".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_an_answer() {
        for payload in ["a defect".to_owned(), format!("{}", 7)] {
            let text = payload.clone();
            let fault = guarded(|| std::panic::panic_any(payload)).unwrap_err();
            assert!(fault.to_string().contains(&text), "{fault}");
        }
        let fault = guarded(|| panic!("static")).unwrap_err();
        assert!(fault.to_string().contains("static"), "{fault}");
    }
}
