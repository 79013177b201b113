//! The smallest clearance of a whole motion, by branch and bound, alone or together with its certificate.

use crate::certify::bisection::Piece;
use crate::certify::motion_bound::MotionBound;
use crate::certify::moving_balls::{MovingBall, MovingGroup};
use crate::certify::obstacles::{Obstacles, may_touch, touches};
use crate::certify::remaining_pieces::RemainingPieces;
use crate::certify::scene_at_rest::SceneAtRest;
use crate::certify::verdict::DEPTH;
use crate::distance::chosen_sections::{Chosen, EVERY_SECTION, NO_SECTION};
use crate::scene::static_scene::Scene;
use pcc_model::{Configuration, Robot, SECTIONS};
use trajectory::Trajectory;

/// Finest tolerance, as a part of the robot's length: below it the search would only measure rounding.
const FINEST_TOLERANCE: f64 = 1e-6;

/// Smallest clearance over the body and the motion, in the robot's unit of length: never above the true minimum, and below it by
/// at most `tolerance`, and near solids by up to a thousandth of a section and a twentieth of the clearance more. +∞ in an empty
/// scene.
///
/// `tolerance` is a length, and taken as 1e-6 of the robot's length if it is smaller.
#[must_use]
pub fn minimum_clearance(
    robot: &Robot,
    scene: &Scene,
    trajectory: &Trajectory,
    tolerance: f64,
) -> f64 {
    let mut found = Found::default();
    let aim = Aim {
        must_be_free: false,
        ..Aim::new(robot, robot, tolerance)
    };
    aim.search(scene, &[], trajectory, &mut found);
    found.least()
}

/// Certifies the executed curve for `padded`, the same robot with thicker tubes, and finds the smallest clearance of the robot itself,
/// from a scene at rest and from balls that move, in one search. None where the padded robot touches something, or comes too close to
/// decide; +∞ where there are no obstacles.
///
/// Distances to solids are as accurate as the clearance of the padded robot needs. `tolerance`: by how much the result may be below the
/// true minimum, a length. A ball whose position or velocity is not finite is never certified.
#[must_use]
pub fn certified_clearance(
    robot: &Robot,
    padded: &Robot,
    (scene, moving): (&Scene, &[MovingBall]),
    trajectory: &Trajectory,
    tolerance: f64,
) -> Option<f64> {
    debug_assert_eq!(robot.section_lengths, padded.section_lengths);
    let mut found = Found::default();
    Aim::new(robot, padded, tolerance).search(scene, moving, trajectory, &mut found);
    found.is_free.then(|| found.least())
}

/// The lower bound, or −∞ where it is NaN.
fn or_unbounded(lowest: f64) -> f64 {
    if lowest.is_nan() {
        f64::NEG_INFINITY
    } else {
        lowest
    }
}

/// Segments of a motion that follow each other, at least one, with their bounds.
#[derive(Clone, Copy)]
struct Segments<'a> {
    pieces: &'a [Piece],
    bounds: &'a [MotionBound],
}

impl Segments<'_> {
    fn split_at(&self, count: usize) -> (Self, Self) {
        let pieces = self.pieces.split_at(count);
        let bounds = self.bounds.split_at(count);
        let part = |pieces, bounds| Self { pieces, bounds };
        (part(pieces.0, bounds.0), part(pieces.1, bounds.1))
    }
}

/// An interval of the motion.
struct Interval<'a, S> {
    segments: Segments<'a>,
    from: S,
    to: S,
    /// Lower bounds of the clearance of each section during the interval; +∞ for a section that is not refined further.
    lowest: [f64; SECTIONS],
}

impl<S> Interval<'_, S> {
    fn least(&self) -> f64 {
        self.lowest.into_iter().fold(f64::INFINITY, f64::min)
    }
}

/// What a search finds, over all obstacles.
#[derive(Clone, Copy)]
struct Found {
    /// Smallest clearance that was measured.
    attained: f64,
    /// Lower bound of the clearances in all intervals and of all sections that were not refined further.
    lower_bound: f64,
    /// False once the padded robot cannot be certified.
    is_free: bool,
}

impl Default for Found {
    fn default() -> Self {
        Self {
            attained: f64::INFINITY,
            lower_bound: f64::INFINITY,
            is_free: true,
        }
    }
}

impl Found {
    /// Smallest clearance of the motion, once it was searched.
    fn least(&self) -> f64 {
        self.attained.min(self.lower_bound)
    }
}

/// What a search is to find, and how accurately.
#[derive(Clone, Copy)]
struct Aim<'a> {
    /// The robot whose clearances are bounded, with padded tubes.
    padded: &'a Robot,
    /// How much thicker the padded tubes are than those whose clearance is sought, by section, a length.
    padding: [f64; SECTIONS],
    tolerance: f64,
    /// Whether the padded robot is to be certified: the search ends where it touches something, or may after all bisections.
    must_be_free: bool,
}

impl<'a> Aim<'a> {
    fn new(robot: &Robot, padded: &'a Robot, tolerance: f64) -> Self {
        let robot_length: f64 = robot.section_lengths.iter().sum();
        Self {
            padded,
            padding: std::array::from_fn(|k| padded.tube_radii[k] - robot.tube_radii[k]),
            tolerance: tolerance.max(FINEST_TOLERANCE * robot_length),
            must_be_free: true,
        }
    }

    /// Searches the whole motion among a scene at rest, then among moving balls.
    fn search(
        self,
        scene: &Scene,
        moving: &[MovingBall],
        trajectory: &Trajectory,
        found: &mut Found,
    ) {
        if scene.is_empty() && moving.is_empty() {
            return;
        }
        let pieces = RemainingPieces::new(trajectory.knots(), 0.0);
        let pieces: Vec<Piece> = (0..pieces.count()).map(|i| pieces.piece(i)).collect();
        let bound = |piece: &Piece| MotionBound::of_curve(&piece.curve);
        let bounds: Vec<MotionBound> = pieces.iter().map(bound).collect();
        let segments = Segments {
            pieces: &pieces,
            bounds: &bounds,
        };
        if !scene.is_empty() {
            let obstacles = SceneAtRest::new(self.padded, scene);
            self.among(&obstacles, segments, found);
        }
        for obstacles in MovingGroup::all(moving) {
            if found.is_free {
                self.among(&obstacles, segments, found);
            }
        }
    }

    fn among(self, obstacles: &impl Obstacles, segments: Segments, found: &mut Found) {
        let mut search = Search {
            aim: self,
            obstacles,
            found,
        };
        search.whole(segments);
    }
}

/// A branch-and-bound search for the smallest clearance.
struct Search<'a, O> {
    aim: Aim<'a>,
    obstacles: &'a O,
    found: &'a mut Found,
}

impl<O: Obstacles> Search<'_, O> {
    fn whole(&mut self, segments: Segments) {
        let (first, last) = (
            &segments.pieces[0],
            &segments.pieces[segments.pieces.len() - 1],
        );
        let from = self.measure(first.start(), first.begin, &EVERY_SECTION);
        let to = self.measure(&last.curve.control[5], last.end(), &EVERY_SECTION);
        let whole = self.interval(segments, from, to);
        self.refine(&whole, DEPTH);
    }

    fn measure(&mut self, configuration: &Configuration, time: f64, chosen: &Chosen) -> O::State {
        let Aim {
            padded,
            padding,
            must_be_free,
            ..
        } = &self.aim;
        let at = self.obstacles.state(padded, configuration, time, chosen);
        for (clearance, padding) in O::clearances(&at).iter().zip(padding) {
            self.found.attained = self.found.attained.min(clearance + padding);
        }
        self.found.is_free &= !(*must_be_free && touches::<O>(&at));
        at
    }

    fn interval<'b>(
        &self,
        segments: Segments<'b>,
        from: O::State,
        to: O::State,
    ) -> Interval<'b, O::State> {
        let bound = MotionBound::of_successive(segments.bounds);
        let lowest = self.obstacles.lowest(&from, &to, self.aim.padded, &bound);
        Interval {
            segments,
            from,
            to,
            lowest,
        }
    }

    /// Halves an interval until no part of it can be below the smallest clearance measured, nor touch anything where the robot is
    /// to be certified; the half with the lower bound first, where the smaller clearances are.
    fn refine(&mut self, interval: &Interval<'_, O::State>, depth: u32) {
        let Aim {
            padding,
            tolerance,
            must_be_free,
            ..
        } = self.aim;
        let touching = may_touch(interval.lowest).map(|may| may && must_be_free);
        let lowest: [f64; SECTIONS] = std::array::from_fn(|k| interval.lowest[k] + padding[k]);
        let enough = self.found.attained - tolerance;
        let open = std::array::from_fn(|k| touching[k] || lowest[k] < enough);
        let closed = (0..SECTIONS).filter(|k| !open[*k]);
        let closed = closed.map(|k| or_unbounded(lowest[k]));
        self.found.lower_bound = closed.fold(self.found.lower_bound, f64::min);
        if open == NO_SECTION || !self.found.is_free {
            return;
        }
        let [piece] = interval.segments.pieces else {
            return self.divide(&interval.segments, interval, &open, depth);
        };
        // Where only the tolerance is missed, halving goes on: the bounds come as near to what is attained as one likes.
        if depth == 0 && touching != NO_SECTION {
            self.found.is_free = false;
            return;
        }
        let halves: [Piece; 2] = piece.halves().into();
        let segments = Segments {
            pieces: &halves,
            bounds: &[&halves[0], &halves[1]].map(|half| MotionBound::of_curve(&half.curve)),
        };
        self.divide(&segments, interval, &open, depth.saturating_sub(1));
    }

    fn divide(
        &mut self,
        segments: &Segments<'_>,
        interval: &Interval<'_, O::State>,
        open: &Chosen,
        depth: u32,
    ) {
        let (first, second) = segments.split_at(segments.pieces.len() / 2);
        let middle = &second.pieces[0];
        let between = self.measure(middle.start(), middle.begin, open);
        let first = self.interval(first, interval.from, between);
        let second = self.interval(second, between, interval.to);
        let (lower, higher) = if second.least() < first.least() {
            (second, first)
        } else {
            (first, second)
        };
        self.refine(&lower, depth);
        self.refine(&higher, depth);
    }
}
