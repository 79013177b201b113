//! Following a line of the tip: all frames of a path iterated together, each towards its point and its neighbours.

use super::kinematics::{Limbs, Shapes, tip_step};
use super::lanes::{LANES, Lanes};
use crate::path::{WAYPOINTS, parameter};
use pcc_model::{Configuration, DOF, Point, Robot};

/// Iterations at most (docs/evaluation.md "The reference setting").
pub(super) const ITERATIONS: usize = 200;
/// Tip distance that counts as reached, section lengths.
pub(super) const TOLERANCE: f64 = 1e-3;
/// Gain of the descent of Σ‖ζ_{h+1} − ζ_h‖² in the null space of the tip.
const CONTINUITY: f64 = 0.1;
/// Frames with one vector of padding on either side, so that neighbours are loads too.
const PADDED: usize = LANES + WAYPOINTS + LANES;

/// Room for one path and its tip line, component by component.
pub(super) struct PathSolver {
    limbs: Limbs,
    line: [[f64; WAYPOINTS]; 3],
    frames: Box<[[f64; PADDED]; DOF]>,
    next: Box<[[f64; PADDED]; DOF]>,
}

impl PathSolver {
    pub(super) fn new(robot: &Robot) -> Self {
        Self {
            limbs: Limbs::of(robot),
            line: [[0.0; WAYPOINTS]; 3],
            frames: Box::new([[0.0; PADDED]; DOF]),
            next: Box::new([[0.0; PADDED]; DOF]),
        }
    }

    /// Prepares the straight way of the tip to a target, with shapes that change evenly from `start` to `end`.
    pub(super) fn start(
        &mut self,
        robot: &Robot,
        target: &Point,
        start: &Configuration,
        end: &Configuration,
    ) {
        let from = robot.tip(start);
        self.set_line(|h| from.lerp(target, parameter(h)));
        for h in 0..WAYPOINTS {
            self.set_frame(h, &start.lerp(end, parameter(h)));
        }
    }

    /// Sets what is followed: one point of the tip for each frame; the first and the last one do not count.
    pub(super) fn set_line(&mut self, point: impl Fn(usize) -> Point) {
        for h in 0..WAYPOINTS {
            let p = point(h);
            for axis in 0..3 {
                self.line[axis][h] = p[axis];
            }
        }
    }

    /// Sets frame h.
    pub(super) fn set_frame(&mut self, h: usize, shape: &Configuration) {
        for d in 0..DOF {
            self.frames[d][LANES + h] = shape[d];
        }
    }

    /// Frame h.
    pub(super) fn frame(&self, h: usize) -> Configuration {
        Configuration::from_fn(|d, _| self.frames[d][LANES + h])
    }

    /// Iterates the frames between the ends until every tip is on its point; whether that came about.
    pub(super) fn solve(&mut self) -> bool {
        for _ in 0..ITERATIONS {
            if self.sweep() <= TOLERANCE * TOLERANCE {
                return true;
            }
            std::mem::swap(&mut self.frames, &mut self.next);
        }
        self.sweep() <= TOLERANCE * TOLERANCE
    }

    /// One step of all frames into `next`; the largest squared tip distance before it.
    #[inline(always)]
    fn sweep(&mut self) -> f64 {
        let mut worst = 0.0_f64;
        for first in (0..WAYPOINTS).step_by(LANES) {
            let shapes = self.shapes(first);
            let wish = std::array::from_fn(|d| {
                let [before, at, after] =
                    [7, 8, 9].map(|from| Lanes::load(&self.frames[d], first + from));
                (before + after - at - at) * (2.0 * CONTINUITY)
            });
            let points = [0, 1, 2].map(|axis| Lanes::load(&self.line[axis], first));
            let found = tip_step(&self.limbs, &shapes, &points, &wish);
            for (component, next) in self.next.iter_mut().zip(found.next) {
                next.store(component, LANES + first);
            }
            for (lane, distance) in found.squared_distance.0.iter().enumerate() {
                if (1..WAYPOINTS - 1).contains(&(first + lane)) {
                    worst = worst.max(*distance);
                }
            }
        }
        self.keep_ends();
        worst
    }

    fn keep_ends(&mut self) {
        for d in 0..DOF {
            for end in [LANES, LANES + WAYPOINTS - 1] {
                self.next[d][end] = self.frames[d][end];
            }
        }
    }

    /// The eight frames from `first` on.
    #[inline(always)]
    pub(super) fn shapes(&self, first: usize) -> Shapes {
        std::array::from_fn(|d| Lanes::load(&self.frames[d], LANES + first))
    }
}
