//! Certificates for motions in a scene at rest: polylines and executed curves.

use crate::bound::{Stance, Turning};
use crate::chain::{Certifier, Obstacles, Piece, Verdict};
use crate::clearance::Chosen;
use crate::scene::Scene;
use pcc_model::{Backbone, Configuration, Robot, SECTIONS};
use trajectory::{Knot, Trajectory};

/// A scene seen by a tube.
struct AtRest<'a> {
    scene: &'a Scene,
    tube_radii: &'a [f64; SECTIONS],
    /// The tube's radius and the smallest ball's together, by section.
    reach: [f64; SECTIONS],
}

impl Obstacles for AtRest<'_> {
    type Clearances = Instant;

    fn clearances(
        &self,
        shape: &Configuration,
        backbone: &Backbone,
        _: f64,
        chosen: &Chosen,
    ) -> Instant {
        Instant::new(self.scene, shape, backbone, self.tube_radii, chosen)
    }

    fn touch(at: &Instant) -> bool {
        at.touches()
    }

    fn may_touch(&self, from: &Instant, to: &Instant, robot: &Robot, turning: &Turning) -> Chosen {
        may_touch(lowest(robot, turning, from, to, &self.reach))
    }
}

/// Where the body is at one instant, and how clear each section of it that was looked at; +∞ for the others.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Instant {
    pub(crate) clearances: [f64; SECTIONS],
    stance: Stance,
}

impl Instant {
    pub(crate) fn new(
        scene: &Scene,
        shape: &Configuration,
        backbone: &Backbone,
        tube_radii: &[f64; SECTIONS],
        chosen: &Chosen,
    ) -> Self {
        Self {
            clearances: scene.clearances_of(backbone, tube_radii, chosen),
            stance: Stance::new(shape, backbone),
        }
    }

    pub(crate) fn touches(&self) -> bool {
        self.clearances.iter().any(|c| *c < 0.0)
    }
}

/// What a tube's radius and the least radius of all obstacles make together, by section.
pub(crate) fn reach(robot: &Robot, scene: &Scene) -> [f64; SECTIONS] {
    robot.tube_radii.map(|tube| tube + scene.smallest_radius())
}

/// Lower bound of each section's clearance between two instants; `reach` as for [`Sweep::lowest`](crate::bound::Sweep).
pub(crate) fn lowest(
    robot: &Robot,
    turning: &Turning,
    from: &Instant,
    to: &Instant,
    reach: &[f64; SECTIONS],
) -> [f64; SECTIONS] {
    let sweep = turning.sweep(robot, &from.stance, &to.stance);
    std::array::from_fn(|k| sweep.lowest(k, from.clearances[k], to.clearances[k], reach[k], 0.0))
}

/// The sections for which these lower bounds leave room for contact.
pub(crate) fn may_touch(lowest: [f64; SECTIONS]) -> Chosen {
    lowest.map(|clearance| clearance <= 0.0 || clearance.is_nan())
}

fn certifier<'a>(
    robot: &'a Robot,
    scene: &'a Scene,
    has_corners: bool,
) -> Certifier<'a, AtRest<'a>> {
    Certifier {
        robot,
        obstacles: AtRest {
            scene,
            tube_radii: &robot.tube_radii,
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
    let rest = RestOfMotion::new(trajectory.knots(), from_time);
    certifier(robot, scene, false).chain(rest.count(), &|i| rest.piece(i))
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

    /// Pieces that begin before a time, at least one.
    pub(crate) fn count_until(&self, time: f64) -> usize {
        let begun = self.knots.partition_point(|knot| knot.time < time);
        begun.clamp(1, self.count())
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
