//! The certificate of a straight move in configuration space, for searches: most of their edges collide.

use crate::certify::body_state::{BodyState, lowest, reach};
use crate::certify::motion_bound::MotionBound;
use crate::certify::obstacles::may_touch;
use crate::certify::verdict::Verdict;
use crate::distance::chosen_sections::{Chosen, EVERY_SECTION, NO_SECTION};
use crate::scene::static_scene::Scene;
use arrayvec::ArrayVec;
use pcc_model::{Configuration, Robot, SECTIONS};

/// Levels of bisection at which all open intervals are halved before any is halved again: contact is found soonest where the
/// whole edge is measured coarsely first.
const COARSE_LEVELS: u32 = 3;
/// The most open intervals of a coarse level.
const COARSE: usize = 1 << COARSE_LEVELS;

/// Certifies the straight move from configuration `a` to `b` (rad), with at most `depth` bisections; places are fractions of it, and
/// contact is reported where it is found, not where it begins.
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
    let edge = Edge {
        robot,
        scene,
        a,
        b,
        reach: reach(robot, scene),
        bound: MotionBound::of_edge(a, b),
    };
    edge.verdict(depth).err().unwrap_or(Verdict::Free)
}

struct Edge<'a> {
    robot: &'a Robot,
    scene: &'a Scene,
    a: &'a Configuration,
    b: &'a Configuration,
    reach: [f64; SECTIONS],
    /// Bounds on the motion along the whole edge, passed in unit time.
    bound: MotionBound,
}

/// Where the body is at a fraction of the edge.
#[derive(Clone, Copy)]
struct Place {
    at: f64,
    body: BodyState,
}

/// An interval of the edge, and the sections to which contact is not excluded in it.
#[derive(Clone, Copy)]
struct Interval {
    from: Place,
    to: Place,
    open: Chosen,
}

impl Interval {
    fn is_open(&self) -> bool {
        self.open != NO_SECTION
    }
}

impl Edge<'_> {
    fn verdict(&self, depth: u32) -> Result<(), Verdict> {
        // Searches leave from where there is no contact.
        let to = self.place(1.0, &EVERY_SECTION)?;
        let from = self.place(0.0, &EVERY_SECTION)?;
        let whole = self.interval(from, to, 1.0);
        if !whole.is_open() {
            return Ok(());
        }
        let (mut first, mut second) = (ArrayVec::<_, COARSE>::new(), ArrayVec::new());
        let (mut current_level, mut next_level) = (&mut first, &mut second);
        current_level.push(whole);
        let (mut level, mut width) = (0, 1.0);
        while level < depth.min(COARSE_LEVELS) {
            width *= 0.5;
            for interval in current_level.drain(..) {
                let halves = self.halves(&interval, width)?.into_iter();
                next_level.extend(halves.filter(Interval::is_open));
            }
            std::mem::swap(&mut current_level, &mut next_level);
            level += 1;
        }
        let mut open = current_level.iter();
        open.try_for_each(|interval| self.refine(interval, width, depth - level))
    }

    /// Certifies an interval in which contact is not excluded, by at most `depth` bisections, the earlier half first; `width` is its share
    /// of the edge.
    fn refine(&self, interval: &Interval, width: f64, depth: u32) -> Result<(), Verdict> {
        let half_width = 0.5 * width;
        if depth == 0 {
            let at = interval.from.at + half_width;
            return Err(Verdict::Undecided { at });
        }
        for half in self.halves(interval, half_width)? {
            if half.is_open() {
                self.refine(&half, half_width, depth - 1)?;
            }
        }
        Ok(())
    }

    fn halves(&self, interval: &Interval, half_width: f64) -> Result<[Interval; 2], Verdict> {
        let middle = self.place(interval.from.at + half_width, &interval.open)?;
        Ok([
            self.interval(interval.from, middle, half_width),
            self.interval(middle, interval.to, half_width),
        ])
    }

    /// The body at a fraction of the edge; contact of a chosen section there is an error.
    fn place(&self, at: f64, chosen: &Chosen) -> Result<Place, Verdict> {
        let configuration = self.a.lerp(self.b, at);
        let body = BodyState::new(self.robot, self.scene, &configuration, chosen);
        if body.touches() {
            return Err(Verdict::Colliding { at });
        }
        Ok(Place { at, body })
    }

    fn interval(&self, from: Place, to: Place, width: f64) -> Interval {
        let bound = self.bound.part(width);
        let bounds = lowest(self.robot, &bound, &from.body, &to.body, &self.reach);
        Interval {
            from,
            to,
            open: may_touch(bounds),
        }
    }
}
