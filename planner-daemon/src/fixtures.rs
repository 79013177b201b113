//! What the unit tests plan with.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use collision::Scene;
use pcc_model::{Configuration, Robot, SECTIONS, UnitRobot};
use planning::{
    Candidate, Goal, Models, MovingObstacles, Planner, Problem, Request, Sampler, Selection,
};
use shared_types::{message, valid};
use trajectory::Trajectory;

use crate::execution::FollowedMotion;
use crate::live_scene::Progress;
use crate::requests::{MostKnots, PlanTask};

/// The shipped unit robot.
pub(crate) fn unit_robot() -> UnitRobot {
    robot_of_sections(1.0)
}

/// A robot whose sections are this long, m.
pub(crate) fn robot_of_sections(section_length_m: f64) -> UnitRobot {
    let text = include_str!("../../config/robots/unit.toml");
    let robot = Robot::from_toml_str(text, Path::new("unit.toml")).unwrap();
    robot.scaled(section_length_m).to_unit().unwrap()
}

/// From the straight shape to a bent one, nothing in the way.
pub(crate) fn straight_problem() -> Problem {
    Problem {
        start: Configuration::zeros(),
        goal: Goal::Configuration(Configuration::new(0.4, 0.1, -0.3, 0.2, 0.1, 0.5)),
        scene: Scene::default(),
        moving: MovingObstacles::default(),
    }
}

/// One candidate by straight segments.
pub(crate) fn request() -> Request {
    Request {
        candidates: 1,
        seed: 1,
        sampler: Sampler::Straight,
        limits_scale: 1.0,
        padding: [0.0225; SECTIONS],
        knots: 96,
        corrections: planning::MOST_CORRECTIONS,
        start_motion: None,
        previous: None,
        end_to_move: None,
    }
}

/// An order for [`request`].
pub(crate) fn task() -> PlanTask {
    PlanTask {
        request_id: 3,
        problem: Arc::new(straight_problem()),
        request: request(),
        knots: MostKnots {
            from_rest: request().knots,
            in_motion: request().knots,
            end_moved: trajectory::MAX_KNOTS,
        },
        starts_at_robot: false,
        ignores_live_scene: false,
        via: Vec::new(),
        ahead: Vec::new(),
        appends: false,
        moves_end_of: None,
        deadline: Duration::from_millis(20),
        tip_tolerance: 0.01,
        selection: valid::SelectionRule::Best(Selection::ShortestTime),
        requested_mono_ns: None,
        begin_mono_ns: None,
        early: None,
    }
}

/// A candidate from the straight shape to a bent one, some seconds long.
pub(crate) fn candidate() -> Candidate {
    let planner = Planner::new(unit_robot(), Models::default(), 1).unwrap();
    let plan = planner.plan(&straight_problem(), &request(), &|| false);
    plan.unwrap().candidates.remove(0)
}

/// Its motion.
pub(crate) fn motion() -> Trajectory {
    Arc::unwrap_or_clone(candidate().trajectory)
}

/// A robot that follows it, 0.1 s after its begin.
pub(crate) fn followed() -> FollowedMotion {
    FollowedMotion {
        is_blocked: false,
        trajectory_id: 7,
        motion: Arc::new(motion()),
        goals: Arc::default(),
        progress: Progress {
            time_s: 0.1,
            ..Progress::from_begin(0)
        },
        fastest_rate: 1.0,
    }
}

/// A validated controller's state with some changes to zero.
pub(crate) fn controller_state(
    change: impl FnOnce(&mut message::ControllerState),
) -> valid::ControllerState {
    let mut values = message::ControllerState::ZEROED;
    change(&mut values);
    valid::ControllerState::try_from(&values).unwrap()
}
