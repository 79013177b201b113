//! The way of a request through the planner: answer.rs tells it from top to bottom.

pub(crate) mod answer;
pub(crate) mod braking;
pub(crate) mod context;
pub(crate) mod default;
pub(crate) mod exploring;
pub(crate) mod fast;
pub(crate) mod goal_set;
pub(crate) mod learned;
pub(crate) mod missing_goals;
pub(crate) mod previous_plan;
pub(crate) mod selection;
pub(crate) mod straight_line;
pub(crate) mod trees;
pub(crate) mod whole_paths;
