//! The way of a request through the planner: answer.rs tells it from top to bottom.

pub(crate) mod answer;
mod braking;
mod chain;
pub(crate) mod context;
mod default;
mod exploring;
mod fast;
mod goal_set;
mod joined_plan;
mod joining;
mod learned;
mod missing_goals;
mod moved_end;
mod previous_plan;
pub(crate) mod route;
mod segments;
pub(crate) mod selection;
mod straight_line;
mod trees;
mod whole_paths;
