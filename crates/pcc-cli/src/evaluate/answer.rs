//! A planner's answer to one case.

use datasets::Case;
use pcc_model::Configuration;
use planning::{Infeasible, Plan};

/// A case and the planner's answer, with the time that it took, s.
pub(crate) struct Answer {
    pub(crate) case: Case,
    pub(crate) plan: Result<Plan, Infeasible>,
    /// What the planner followed where it is one that ends by the clock: corners of certified edges.
    pub(crate) polylines: Vec<Vec<Configuration>>,
    pub(crate) seconds: f64,
    /// Time until the paths were there that the paper's criterion judges, s: of the paper's rivals, which are corrected and certified after
    /// that; of the others the whole time.
    pub(crate) drawing_s: f64,
}
