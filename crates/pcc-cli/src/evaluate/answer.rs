//! A planner's answer to one case.

use datasets::Case;
use planning::{Infeasible, Plan};

/// A case and the planner's answer, with the time that it took, s.
pub(super) struct Answer {
    pub(super) case: Case,
    pub(super) plan: Result<Plan, Infeasible>,
    pub(super) seconds: f64,
}
