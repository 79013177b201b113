//! Certificates for motions in a scene at rest: polylines and executed curves.

use crate::certify::bisection::{Certifier, Obstacles, Piece};
use crate::certify::body_state::{BodyState, lowest, may_touch, reach};
use crate::certify::motion_bound::MotionBound;
use crate::certify::remaining_pieces::RemainingPieces;
use crate::certify::verdict::Verdict;
use crate::distance::chosen_sections::Chosen;
use crate::scene::static_scene::Scene;
use pcc_model::{Configuration, Robot, SECTIONS};
use trajectory::Trajectory;

/// A scene at rest.
struct SceneAtRest<'a> {
    scene: &'a Scene,
    /// The sum of the tube's radius and the least radius of all obstacles, by section.
    reach: [f64; SECTIONS],
}

impl Obstacles for SceneAtRest<'_> {
    type Clearances = BodyState;

    fn clearances(
        &self,
        robot: &Robot,
        configuration: &Configuration,
        _: f64,
        chosen: &Chosen,
    ) -> BodyState {
        BodyState::new(robot, self.scene, configuration, chosen)
    }

    fn touch(at: &BodyState) -> bool {
        at.touches()
    }

    fn may_touch(
        &self,
        from: &BodyState,
        to: &BodyState,
        robot: &Robot,
        bound: &MotionBound,
    ) -> Chosen {
        may_touch(lowest(robot, bound, from, to, &self.reach))
    }
}

fn certifier<'a>(
    robot: &'a Robot,
    scene: &'a Scene,
    has_corners: bool,
) -> Certifier<'a, SceneAtRest<'a>> {
    Certifier {
        robot,
        obstacles: SceneAtRest {
            scene,
            reach: reach(robot, scene),
        },
        has_corners,
    }
}

/// Certifies a polyline in configuration space; places are edge index + fraction. A single point is a motion at rest.
#[must_use]
pub fn certify_polyline(robot: &Robot, scene: &Scene, points: &[Configuration]) -> Verdict {
    if scene.is_empty() || points.is_empty() {
        return Verdict::Free;
    }
    let last = points.len() - 1;
    let edge = |i: usize| Piece::edge(&points[i], &points[(i + 1).min(last)], i as f64);
    certifier(robot, scene, true).chain(last.max(1), &edge)
}

/// Certifies the executed curve from `from_time` (s) to its end; allocates nothing.
#[must_use]
pub fn certify_trajectory(
    robot: &Robot,
    scene: &Scene,
    trajectory: &Trajectory,
    from_time: f64,
) -> Verdict {
    if scene.is_empty() {
        return Verdict::Free;
    }
    let pieces = RemainingPieces::new(trajectory.knots(), from_time);
    certifier(robot, scene, false).chain(pieces.count(), &|i| pieces.piece(i))
}
