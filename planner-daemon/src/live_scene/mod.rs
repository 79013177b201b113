//! Obstacles that move while the robot does: the scenes of all sources, and whether a motion keeps clear of them.

mod absence;
mod certificates;
mod in_the_way;
mod inbox;
mod moving_ball_cover;
mod planned_scene;
mod progress;
mod publishers;
mod retained_scene;
mod scene_memory;
mod sources;
mod verdict;

pub(crate) use absence::SceneAbsence;
pub(crate) use certificates::{Certificates, RemainingMotion};
pub(crate) use in_the_way::InTheWay;
pub(crate) use inbox::SceneInbox;
pub(crate) use moving_ball_cover::{HEARTBEAT_TIMEOUT_NS, Timing, UNSUPERVISED_S};
pub(crate) use planned_scene::{ExpectedMotion, SceneSnapshot};
pub(crate) use progress::Progress;
pub use scene_memory::SceneMemoryError;
pub(crate) use scene_memory::{MAX_SOURCES, SceneMemory};
pub(crate) use sources::{Arrival, LiveScene};
