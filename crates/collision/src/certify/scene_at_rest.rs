//! A scene at rest, as certificates see it.

use crate::certify::body_state::{BodyState, lowest, reach};
use crate::certify::motion_bound::MotionBound;
use crate::certify::obstacles::Obstacles;
use crate::distance::chosen_sections::Chosen;
use crate::scene::static_scene::Scene;
use pcc_model::{Configuration, Robot, SECTIONS};

/// A scene at rest.
pub(crate) struct SceneAtRest<'a> {
    scene: &'a Scene,
    /// The sum of the tube's radius and the least radius of all obstacles, by section.
    reach: [f64; SECTIONS],
}

impl<'a> SceneAtRest<'a> {
    pub(crate) fn new(robot: &Robot, scene: &'a Scene) -> Self {
        Self {
            scene,
            reach: reach(robot, scene),
        }
    }
}

impl Obstacles for SceneAtRest<'_> {
    type State = BodyState;

    fn state(
        &self,
        robot: &Robot,
        configuration: &Configuration,
        _: f64,
        chosen: &Chosen,
    ) -> BodyState {
        BodyState::new(robot, self.scene, configuration, chosen)
    }

    fn clearances(state: &BodyState) -> [f64; SECTIONS] {
        state.clearances
    }

    fn lowest(
        &self,
        from: &BodyState,
        to: &BodyState,
        robot: &Robot,
        bound: &MotionBound,
    ) -> [f64; SECTIONS] {
        lowest(robot, bound, from, to, &self.reach)
    }
}
