//! Certificates for motions in a scene at rest: polylines and executed curves.

use crate::certify::bisection::{Certifier, Piece};
use crate::certify::remaining_pieces::RemainingPieces;
use crate::certify::scene_at_rest::SceneAtRest;
use crate::certify::verdict::Verdict;
use crate::scene::static_scene::Scene;
use pcc_model::{Configuration, Robot};
use trajectory::Trajectory;

fn certifier<'a>(
    robot: &'a Robot,
    scene: &'a Scene,
    has_corners: bool,
) -> Certifier<'a, SceneAtRest<'a>> {
    Certifier {
        robot,
        obstacles: SceneAtRest::new(robot, scene),
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
