//! Where the body is at one instant, and how clear it can be between two.

use crate::certify::motion_bound::{BackbonePose, MotionBound};
use crate::distance::chosen_sections::Chosen;
use crate::scene::static_scene::Scene;
use pcc_model::{Configuration, Robot, SECTIONS};

/// Where the body is at one instant, and the clearance of each chosen section; +∞ for the others.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BodyState {
    pub(crate) clearances: [f64; SECTIONS],
    pose: BackbonePose,
}

impl BodyState {
    pub(crate) fn new(
        robot: &Robot,
        scene: &Scene,
        configuration: &Configuration,
        chosen: &Chosen,
    ) -> Self {
        let backbone = robot.backbone(configuration);
        Self {
            clearances: scene.clearances_of(&backbone, &robot.tube_radii, chosen),
            pose: BackbonePose::new(configuration, &backbone),
        }
    }

    pub(crate) fn touches(&self) -> bool {
        self.clearances.iter().any(|c| *c < 0.0)
    }
}

/// The sum of each section's tube radius and the least radius of all obstacles.
pub(crate) fn reach(robot: &Robot, scene: &Scene) -> [f64; SECTIONS] {
    robot.tube_radii.map(|tube| tube + scene.smallest_radius())
}

/// Lower bound of each section's clearance between two instants; `reach` is [`reach`]'s of the same robot and scene.
pub(crate) fn lowest(
    robot: &Robot,
    bound: &MotionBound,
    from: &BodyState,
    to: &BodyState,
    reach: &[f64; SECTIONS],
) -> [f64; SECTIONS] {
    let sweep = bound.sweep(robot, &from.pose, &to.pose);
    std::array::from_fn(|k| sweep.lowest(k, [from.clearances[k], to.clearances[k]], reach[k], 0.0))
}
