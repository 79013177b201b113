//! What a planner answered to one case.

use datasets::Case;
use planning::{Infeasible, Plan};

/// A case and what the planner answered.
pub(super) struct Answer {
    pub(super) case: Case,
    pub(super) plan: Result<Plan, Infeasible>,
    pub(super) seconds: f64,
}
