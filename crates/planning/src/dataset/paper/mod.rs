//! The paper's own generator of paths (docs/evaluation.md "The reference setting"; the paper, section IV "Training Data").
//!
//! The straight way of the tip is followed from a start to each of ten terminal solutions; a path that collides is
//! repaired; what reaches, moves in small enough steps and is clear by the sampled criterion is kept. Checked against
//! the paths of the authors' program: from the same ends it makes the same paths.

mod kinematics;
mod lanes;
mod repair;
mod sampled;
mod solver;
mod spline;
mod target;

use super::format::{Check, Row};
use super::generate::{Recipe, split_of};
use crate::path::{WAYPOINTS, Waypoints};
use crate::scenes::{STARTS, draw_balls};
use collision::{Ball, Scene, certify_polyline};
use pcc_model::{Configuration, Point, Robot};
use rand_pcg::Pcg64;
use repair::Repairer;
use serde::{Deserialize, Serialize};
use solver::PathSolver;
use target::Place;
pub use target::TERMINALS;

/// Largest step between neighbouring waypoints, rad.
const LARGEST_STEP: f64 = 0.4;

/// Why targets were dropped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct DroppedTargets {
    /// No ten clear and distinct terminal solutions.
    pub terminal_ik: usize,
    /// Too few starts.
    pub start_sampling: usize,
    /// None of its paths was kept.
    pub zero_retained_paths: usize,
}

/// Why paths were dropped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct DroppedPaths {
    /// The straight way of the tip could not be followed.
    pub workspace_ik: usize,
    /// A step between neighbouring waypoints is too large.
    pub path_constraints: usize,
    /// It collides, and the repair did not help.
    pub collision_repair: usize,
}

/// What became of the paths asked for; as the authors' `dataset_meta.json` names it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PaperReport {
    /// Targets drawn.
    pub requested_targets: usize,
    /// Targets with a path.
    pub actual_targets: usize,
    /// Paths asked for, those of dropped targets too.
    pub requested_paths: usize,
    /// Paths kept.
    pub actual_paths: usize,
    /// Targets dropped.
    pub target_discarded_counts: DroppedTargets,
    /// Paths dropped of targets that were not.
    pub path_failure_counts: DroppedPaths,
}

impl std::ops::AddAssign for PaperReport {
    fn add_assign(&mut self, other: Self) {
        self.requested_targets += other.requested_targets;
        self.actual_targets += other.actual_targets;
        self.requested_paths += other.requested_paths;
        self.actual_paths += other.actual_paths;
        let (sum, more) = (
            &mut self.target_discarded_counts,
            other.target_discarded_counts,
        );
        sum.terminal_ik += more.terminal_ik;
        sum.start_sampling += more.start_sampling;
        sum.zero_retained_paths += more.zero_retained_paths;
        let (sum, more) = (&mut self.path_failure_counts, other.path_failure_counts);
        sum.workspace_ik += more.workspace_ik;
        sum.path_constraints += more.path_constraints;
        sum.collision_repair += more.collision_repair;
    }
}

/// Generates the rows of the targets with the given indices; the result depends on the recipe and the indices alone.
#[must_use]
pub fn generate_paper_block(
    robot: &Robot,
    recipe: &Recipe,
    targets: std::ops::Range<u64>,
) -> (Vec<Row>, PaperReport) {
    let mut generator = Generator {
        robot,
        recipe,
        solver: PathSolver::new(robot),
        repairer: Repairer::new(robot),
        rows: Vec::new(),
        report: PaperReport::default(),
    };
    for index in targets {
        generator.add_target(index);
    }
    (generator.rows, generator.report)
}

/// One target that was not dropped.
struct Case {
    index: u64,
    scene: Scene,
    tip: Point,
    terminals: [Configuration; TERMINALS],
    starts: [Configuration; STARTS],
}

struct Generator<'a> {
    robot: &'a Robot,
    recipe: &'a Recipe,
    solver: PathSolver,
    repairer: Repairer<'a>,
    rows: Vec<Row>,
    report: PaperReport,
}

impl Generator<'_> {
    fn add_target(&mut self, index: u64) {
        self.report.requested_targets += 1;
        self.report.requested_paths += self.recipe.starts * self.recipe.ends;
        let Some(case) = self.draw(index) else {
            return;
        };
        let before = self.rows.len();
        for (start_index, start) in case.starts.iter().enumerate().take(self.recipe.starts) {
            for (ik_index, end) in case.terminals.iter().enumerate().take(self.recipe.ends) {
                if let Some(path) = self.path(case.scene.balls(), &case.tip, start, end) {
                    self.keep(&case, start_index, ik_index, path);
                }
            }
        }
        let kept = self.rows.len() - before;
        self.report.actual_paths += kept;
        self.report.actual_targets += usize::from(kept > 0);
        self.report.target_discarded_counts.zero_retained_paths += usize::from(kept == 0);
    }

    fn draw(&mut self, index: u64) -> Option<Case> {
        let mut rng = Pcg64::new(u128::from(self.recipe.seed), u128::from(index) | 1 << 64);
        let balls = draw_balls(self.recipe.setting, index, &mut rng);
        let place = Place {
            robot: self.robot,
            balls: &balls,
        };
        let dropped = &mut self.report.target_discarded_counts;
        let solved = place
            .target(&mut rng)
            .and_then(|(generator, tip)| Some((tip, place.terminals(&generator, &tip, &mut rng)?)));
        let Some((tip, terminals)) = solved else {
            dropped.terminal_ik += 1;
            return None;
        };
        let Some(starts) = place.starts(&tip, &mut rng) else {
            dropped.start_sampling += 1;
            return None;
        };
        Some(Case {
            index,
            scene: Scene::new(balls).ok()?,
            tip,
            terminals,
            starts,
        })
    }

    /// The path from a start to a terminal solution, counted if it is dropped.
    fn path(
        &mut self,
        balls: &[Ball],
        target: &Point,
        start: &Configuration,
        end: &Configuration,
    ) -> Option<Waypoints> {
        let dropped = &mut self.report.path_failure_counts;
        self.solver.start(self.robot, target, start, end);
        if !self.solver.solve() {
            dropped.workspace_ik += 1;
            return None;
        }
        if !self.repairer.make_clear(&mut self.solver, balls) {
            dropped.collision_repair += 1;
            return None;
        }
        let path: Waypoints = (0..WAYPOINTS).map(|h| self.solver.frame(h)).collect();
        let largest = path.windows(2).map(|w| (w[1] - w[0]).norm());
        if largest.fold(0.0, f64::max) > LARGEST_STEP {
            dropped.path_constraints += 1;
            return None;
        }
        Some(path)
    }

    /// Adds a row; what is checked is the path as it will be stored, with single precision.
    fn keep(&mut self, case: &Case, start_index: usize, ik_index: usize, mut path: Waypoints) {
        for shape in &mut path {
            *shape = shape.map(|angle| f64::from(angle as f32));
        }
        let check = exact_check(self.robot, &case.scene, &path);
        self.rows.push(Row {
            path,
            target_tip: case.tip,
            target_index: case.index as i32,
            start_index: start_index as i16,
            ik_index: ik_index as i16,
            split: split_of(self.recipe, case.index),
            balls: case.scene.balls().to_vec(),
            check: Some(check),
        });
    }
}

fn exact_check(robot: &Robot, scene: &Scene, path: &[Configuration]) -> Check {
    let clearance = |shape| scene.clearance(&robot.backbone(shape), robot.tube_radius);
    Check {
        clearance: path.iter().map(clearance).fold(f64::INFINITY, f64::min) as f32,
        is_certified: certify_polyline(robot, scene, path).is_free(),
    }
}
