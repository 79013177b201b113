//! Certificates for motions among balls at rest: edges, polylines, executed curves.

use crate::bound::Sweep;
use crate::chain::{Certifier, DEPTH, Obstacles, Piece, Verdict};
use crate::scene::Scene;
use pcc_model::{Backbone, Configuration, Robot, SECTIONS};
use trajectory::{Knot, Trajectory};

/// A scene seen by a tube.
struct AtRest<'a> {
    scene: &'a Scene,
    tube_radius: f64,
    /// The tube's radius and the smallest ball's together.
    reach: f64,
}

impl Obstacles for AtRest<'_> {
    type Clearances = [f64; SECTIONS];

    fn clearances(&self, backbone: &Backbone, _: f64) -> Self::Clearances {
        self.scene.section_clearances(backbone, self.tube_radius)
    }

    fn touch(clearances: &Self::Clearances) -> bool {
        clearances.iter().any(|c| *c < 0.0)
    }

    fn are_clear(
        &self,
        from: &Self::Clearances,
        to: &Self::Clearances,
        sweep: &Sweep,
        _: f64,
    ) -> bool {
        (0..SECTIONS).all(|k| sweep.lowest(k, from[k], to[k], self.reach, 0.0) > 0.0)
    }
}

fn certifier<'a>(
    robot: &'a Robot,
    scene: &'a Scene,
    growth: f64,
    depth: u32,
    has_corners: bool,
) -> Certifier<'a, AtRest<'a>> {
    let tube_radius = robot.tube_radius + growth;
    Certifier {
        robot,
        obstacles: AtRest {
            scene,
            tube_radius,
            reach: tube_radius + scene.smallest_radius(),
        },
        depth,
        has_corners,
    }
}

/// Certifies a straight move in configuration space, with at most `depth` bisections; places are fractions of it.
#[must_use]
pub fn certify_edge(
    robot: &Robot,
    scene: &Scene,
    a: &Configuration,
    b: &Configuration,
    depth: u32,
) -> Verdict {
    if scene.is_empty() {
        return Verdict::Free;
    }
    certifier(robot, scene, 0.0, depth, false).chain(1, &|_| Piece::edge(a, b, 0.0))
}

/// Certifies a polyline in configuration space; places are edge index + fraction. A single point is a motion at rest.
#[must_use]
pub fn certify_polyline(robot: &Robot, scene: &Scene, points: &[Configuration]) -> Verdict {
    if scene.is_empty() || points.is_empty() {
        return Verdict::Free;
    }
    let last = points.len() - 1;
    let edge = |i: usize| Piece::edge(&points[i], &points[(i + 1).min(last)], i as f64);
    certifier(robot, scene, 0.0, DEPTH, true).chain(last.max(1), &edge)
}

/// Certifies the executed curve from `from_time` (s) to its end, for a tube grown by `growth`; allocates nothing.
#[must_use]
pub fn certify_trajectory(
    robot: &Robot,
    scene: &Scene,
    trajectory: &Trajectory,
    from_time: f64,
    growth: f64,
) -> Verdict {
    if scene.is_empty() {
        return Verdict::Free;
    }
    let rest = RestOfMotion::new(trajectory.knots(), from_time);
    certifier(robot, scene, growth, DEPTH, false).chain(rest.count(), &|i| rest.piece(i))
}

/// The pieces of a motion that are left from a time on; at least one, be it of no duration.
pub(crate) struct RestOfMotion<'a> {
    knots: &'a [Knot],
    from_time: f64,
}

impl<'a> RestOfMotion<'a> {
    pub(crate) fn new(knots: &'a [Knot], from_time: f64) -> Self {
        let passed = knots.partition_point(|k| k.time <= from_time);
        let first = passed.saturating_sub(1).min(knots.len() - 2);
        Self {
            knots: &knots[first..],
            from_time: from_time.max(0.0),
        }
    }

    pub(crate) fn count(&self) -> usize {
        self.knots.len() - 1
    }

    pub(crate) fn piece(&self, index: usize) -> Piece {
        let piece = Piece::between(&self.knots[index], &self.knots[index + 1]);
        if index == 0 {
            piece.remaining(self.from_time)
        } else {
            piece
        }
    }
}
