//! Following a line of the tip: all frames of a path iterated together, each towards its point and its neighbours.

use super::kinematics::{project_section, tip_step};
use super::settings::CONTINUITY;
use fearless_simd::{Level, dispatch};
use pcc_model::{Configuration, DOF, Point, SECTIONS, UnitRobot};
use planning::{WAYPOINTS, parameter};

/// Iterations at most (docs/evaluation.md "The reference setting").
pub(super) const ITERATIONS: usize = 200;
/// Tip distance that counts as reached, section lengths.
pub(super) const TOLERANCE: f64 = 1e-3;
/// Frame h has the place h + 1, so that the ends have neighbours to load, too.
const PADDED: usize = WAYPOINTS + 2;

/// Frames component by component.
type Frames = [[f64; PADDED]; DOF];

/// Room for one path and its tip line.
pub(super) struct PathSolver {
    lengths: [f64; SECTIONS],
    limit: f64,
    line: [[f64; WAYPOINTS]; 3],
    frames: Box<Frames>,
    next: Box<Frames>,
}

impl PathSolver {
    pub(super) fn new(robot: &UnitRobot) -> Self {
        Self {
            lengths: robot.section_lengths,
            limit: robot.bending_limit,
            line: [[0.0; WAYPOINTS]; 3],
            frames: Box::new([[0.0; PADDED]; DOF]),
            next: Box::new([[0.0; PADDED]; DOF]),
        }
    }

    /// Prepares the straight way of the tip to a target, with shapes that change evenly from `start` to `end`.
    pub(super) fn start(
        &mut self,
        robot: &UnitRobot,
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
            self.frames[d][h + 1] = shape[d];
        }
    }

    /// Frame h.
    pub(super) fn frame(&self, h: usize) -> Configuration {
        Configuration::from_fn(|d, _| self.frames[d][h + 1])
    }

    /// Largest step between neighbouring frames, rad.
    pub(super) fn largest_step(&self) -> f64 {
        let step = |h| (self.frame(h + 1) - self.frame(h)).norm();
        (0..WAYPOINTS - 1).map(step).fold(0.0, f64::max)
    }

    /// The components of all frames.
    pub(super) fn components(&self) -> [&[f64]; DOF] {
        std::array::from_fn(|d| &self.frames[d][1..=WAYPOINTS])
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

    /// Makes one step of all frames into `next`; the largest squared tip distance before it.
    fn sweep(&mut self) -> f64 {
        let mut squared_distances = [0.0; WAYPOINTS];
        dispatch!(Level::new(), _ => self.step(&mut squared_distances));
        for (frames, next) in self.frames.iter().zip(self.next.iter_mut()) {
            (next[1], next[WAYPOINTS]) = (frames[1], frames[WAYPOINTS]);
        }
        let inner = &squared_distances[1..WAYPOINTS - 1];
        inner.iter().copied().fold(0.0, f64::max)
    }

    /// Makes one step of all frames into `next`, the ends included; the squared tip distance of each frame before it.
    #[inline(always)]
    fn step(&mut self, squared_distances: &mut [f64; WAYPOINTS]) {
        step_frames(
            &self.lengths,
            &self.line,
            &self.frames,
            &mut self.next,
            squared_distances,
        );
        for [x, y] in self.next.as_chunks_mut::<2>().0 {
            project_section(self.limit, &mut x[1..=WAYPOINTS], &mut y[1..=WAYPOINTS]);
        }
    }
}

/// The step of each frame; the ends get one too, which nobody uses, so that the loop has no remainder.
#[inline(always)]
fn step_frames(
    lengths: &[f64; SECTIONS],
    line: &[[f64; WAYPOINTS]; 3],
    frames: &Frames,
    next: &mut Frames,
    squared_distances: &mut [f64; WAYPOINTS],
) {
    for h in 0..WAYPOINTS {
        let (mut shape, mut wish) = ([0.0; DOF], [0.0; DOF]);
        for d in 0..DOF {
            shape[d] = frames[d][h + 1];
            let bend = frames[d][h] + frames[d][h + 2] - shape[d] - shape[d];
            wish[d] = bend * (2.0 * CONTINUITY);
        }
        let point = [line[0][h], line[1][h], line[2][h]];
        let step = tip_step(lengths, &shape, &point, &wish);
        for (component, value) in next.iter_mut().zip(step.next) {
            component[h + 1] = value;
        }
        squared_distances[h] = step.squared_distance;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::unit_robot;

    fn solver() -> (UnitRobot, PathSolver, Point) {
        let robot = unit_robot();
        let start = Configuration::from_column_slice(&[0.9, -0.4, 0.2, 0.6, -0.4, 0.7]);
        let end = Configuration::from_column_slice(&[-0.3, 0.9, 0.3, -0.6, 0.5, 0.8]);
        let target = robot.tip(&end);
        let mut solver = PathSolver::new(&robot);
        solver.start(&robot, &target, &start, &end);
        (robot, solver, target)
    }

    #[test]
    fn the_tip_follows_the_line_between_ends_that_stay() {
        let (robot, mut solver, target) = solver();
        let ends = [0, 63].map(|h| solver.frame(h));
        let from = robot.tip(&ends[0]);
        let miss = |solver: &PathSolver, h: usize| {
            (robot.tip(&solver.frame(h)) - from.lerp(&target, parameter(h))).norm()
        };
        assert!(miss(&solver, 31) > 0.05, "there is something to solve");
        assert!(solver.solve());
        assert!((0..WAYPOINTS).all(|h| miss(&solver, h) <= TOLERANCE));
        assert_eq!(ends, [0, 63].map(|h| solver.frame(h)));
    }

    #[test]
    fn a_line_out_of_reach_is_not_followed() {
        let (_, mut solver, _) = solver();
        solver.set_line(|_| Point::new(0.0, 0.0, 3.1));
        assert!(!solver.solve());
        assert!((1..63).all(|h| solver.frame(h).iter().all(|angle| angle.is_finite())));
    }

    #[test]
    fn every_processor_makes_the_same_step() {
        let (_, mut solver, _) = solver();
        let mut distances = [0.0; WAYPOINTS];
        solver.step(&mut distances);
        let plain = solver.next.clone();
        solver.next.as_flattened_mut().fill(f64::NAN);
        let worst = solver.sweep();
        assert_eq!(worst, distances[1..63].iter().copied().fold(0.0, f64::max));
        for (plain, widest) in plain.iter().zip(solver.next.iter()) {
            assert_eq!(plain[2..64], widest[2..64]);
        }
    }
}
