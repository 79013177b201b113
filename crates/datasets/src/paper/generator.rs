//! From a recipe to the rows of its targets.

use super::path_maker::{Obstruction, PathMaker};
use super::target::{Surroundings, TERMINALS};
use crate::format::counts::Counts;
use crate::recipe::Recipe;
use crate::row::{Check, Row};
use crate::scenes::{STARTS, draw_balls};
use collision::Scene;
use pcc_model::{Configuration, Point, UnitRobot};
use planning::Waypoints;
use rand_pcg::Pcg64;

/// Why a target is dropped, by the authors' names: fewer than ten clear and distinct terminal solutions; too few starts; none of its paths
/// kept.
const OF_TARGETS: [&str; 3] = ["terminal_ik", "start_sampling", "zero_retained_paths"];
/// Why a path is missing: its straight tip path cannot be followed; a step is too large; the repair leaves a collision.
const OF_PATHS: [&str; 3] = ["workspace_ik", "path_constraints", "collision_repair"];

/// Version of [`generate_paper_block`]; raise it with every change that makes other rows from the same recipe.
pub const PAPER_VERSION: u32 = 1;

/// Generates the rows of the targets with the given indices; the result depends on the recipe and the indices alone.
#[must_use]
pub fn generate_paper_block(
    robot: &UnitRobot,
    recipe: &Recipe,
    targets: std::ops::Range<u64>,
) -> (Vec<Row>, Counts) {
    let mut generator = Generator {
        robot,
        recipe,
        paths: PathMaker::new(robot),
        rows: Vec::new(),
        counts: Counts::with_reasons(&OF_TARGETS, &OF_PATHS),
    };
    for index in targets {
        generator.add_target(index);
    }
    (generator.rows, generator.counts)
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
    robot: &'a UnitRobot,
    recipe: &'a Recipe,
    paths: PathMaker<'a>,
    rows: Vec<Row>,
    counts: Counts,
}

impl Generator<'_> {
    fn add_target(&mut self, index: u64) {
        self.counts.requested_targets += 1;
        self.counts.requested_paths += self.recipe.starts * self.recipe.ends;
        let Some(case) = self.draw(index) else {
            return;
        };
        let before = self.rows.len();
        for (start_index, start) in case.starts.iter().enumerate().take(self.recipe.starts) {
            for (ik_index, end) in case.terminals.iter().enumerate().take(self.recipe.ends) {
                if let Some(path) = self.path(&case, start, end) {
                    self.keep(&case, start_index, ik_index, path);
                }
            }
        }
        let kept = self.rows.len() - before;
        self.counts.actual_paths += kept;
        if kept > 0 {
            self.counts.actual_targets += 1;
        } else {
            self.counts.drop_target(OF_TARGETS[2]);
        }
    }

    fn draw(&mut self, index: u64) -> Option<Case> {
        let mut rng = Pcg64::new(u128::from(self.recipe.seed), u128::from(index) | 1 << 64);
        let balls = draw_balls(self.recipe.setting, index, &mut rng);
        let scene = Scene::new(balls).expect("the balls of a setting are few and finite");
        let place = Surroundings {
            robot: self.robot,
            balls: scene.balls(),
        };
        let solved = place
            .target(&mut rng)
            .and_then(|(generator, tip)| Some((tip, place.terminals(&generator, &tip, &mut rng)?)));
        let Some((tip, terminals)) = solved else {
            self.counts.drop_target(OF_TARGETS[0]);
            return None;
        };
        let Some(starts) = place.starts(&tip, &mut rng) else {
            self.counts.drop_target(OF_TARGETS[1]);
            return None;
        };
        Some(Case {
            index,
            starts,
            terminals,
            tip,
            scene,
        })
    }

    /// The path from a start to a terminal solution, counted if it is dropped.
    fn path(
        &mut self,
        case: &Case,
        start: &Configuration,
        end: &Configuration,
    ) -> Option<Waypoints> {
        let path = self
            .paths
            .path(case.scene.balls(), &case.tip, start, end)
            .map_err(|obstruction| match obstruction {
                Obstruction::TipLine => OF_PATHS[0],
                Obstruction::LargeStep => OF_PATHS[1],
                Obstruction::Collision => OF_PATHS[2],
            });
        if let Err(reason) = path {
            self.counts.drop_paths(reason, 1);
        }
        path.ok()
    }

    /// Adds a row; what is checked is the path as it will be stored, with single precision.
    fn keep(&mut self, case: &Case, start_index: usize, ik_index: usize, mut path: Waypoints) {
        for shape in &mut path {
            *shape = shape.map(|angle| f64::from(angle as f32));
        }
        let check = Check::of(self.robot, &case.scene, &path);
        self.rows.push(Row {
            path,
            target_tip: case.tip,
            target_index: case.index as i32,
            start_index: start_index as i16,
            ik_index: ik_index as i16,
            split: self.recipe.split_of(case.index),
            balls: case.scene.balls().to_vec(),
            check: Some(check),
        });
    }
}

#[cfg(test)]
mod tests {
    use super::super::repair::Repairer;
    use super::super::settings::LARGEST_STEP;
    use super::super::solver::PathSolver;
    use super::*;
    use crate::fixtures::unit_robot;
    use crate::format::dataset::Dataset;
    use crate::scenes::Setting;
    use std::path::Path;

    fn recipe(setting: Setting, starts: usize, ends: usize) -> Recipe {
        Recipe {
            setting,
            seed: 11,
            starts,
            ends,
            trees: 1,
            test_only: false,
        }
    }

    /// The authors stored single precision, from which some solves and repairs start a little differently.
    #[test]
    fn from_their_ends_the_authors_paths_come_out() {
        let folder = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../tests/data/reference-mixed-sample"
        );
        let sample = Dataset::read(Path::new(folder)).unwrap();
        let robot = unit_robot();
        let (mut solver, mut repairer) = (PathSolver::new(&robot), Repairer::new(&robot));
        let mut repaired = 0;
        for row in &sample.rows {
            let [start, end] = [row.path[0], row.path[63]];
            solver.start(&robot, &row.target_tip, &start, &end);
            assert!(solver.solve());
            let is_clear = repairer.is_clear(&solver, &row.balls);
            assert!(is_clear || repairer.repair(&mut solver, &row.balls));
            repaired += usize::from(!is_clear);
            let miss = |(h, shape)| (solver.frame(h) - shape as &Configuration).amax();
            let miss = row.path.iter().enumerate().map(miss).fold(0.0, f64::max);
            assert!(miss < if is_clear { 5e-6 } else { 3e-4 }, "{miss}");
        }
        assert_eq!(repaired, 13, "the sample has repaired paths");
    }

    #[test]
    fn kept_paths_keep_the_limits_and_every_path_is_accounted_for() {
        let robot = unit_robot();
        let (rows, counts) =
            generate_paper_block(&robot, &recipe(Setting::Reference(None), 5, 10), 0..60);
        let (targets, paths) = (&counts.target_discarded_counts, &counts.path_failure_counts);
        let lost_targets = targets["terminal_ik"] + targets["start_sampling"];
        assert_eq!(counts.requested_paths, 60 * 50);
        assert_eq!(
            rows.len() + paths["total"] + 50 * lost_targets,
            counts.requested_paths
        );
        assert!(targets["terminal_ik"] > 0 && targets["start_sampling"] > 0);
        assert!(OF_PATHS.iter().all(|reason| paths[*reason] > 0));
        for row in &rows {
            let largest = row
                .path
                .windows(2)
                .map(|w| (w[1] - w[0]).norm())
                .fold(0.0, f64::max);
            assert!(largest <= LARGEST_STEP + 1e-6);
            assert!(
                row.path
                    .iter()
                    .all(|shape| robot.limit_excess(shape) < 1e-6)
            );
            assert!((robot.tip(&row.path[63]) - row.target_tip).norm() <= 1.001e-3);
            let mut sampled = f64::INFINITY;
            for (shape, ball) in row
                .path
                .iter()
                .flat_map(|q| row.balls.iter().map(move |b| (q, b)))
            {
                let backbone = robot.backbone(shape);
                for (section, third) in (0..3).flat_map(|s| (1..=3).map(move |t| (s, t))) {
                    let point = backbone.point(section, f64::from(third) / 3.0);
                    sampled = sampled.min((point - ball.centre).norm() - ball.radius - 0.2);
                }
            }
            assert!(sampled > -1e-6);
            let check = row.check.unwrap();
            assert!(f64::from(check.clearance) <= sampled + 1e-6);
            assert!(!check.is_certified || check.clearance >= 0.0);
        }
    }

    #[test]
    fn a_target_without_a_path_is_dropped() {
        let robot = unit_robot();
        let (rows, counts) =
            generate_paper_block(&robot, &recipe(Setting::ObstacleFree, 1, 1), 0..24);
        assert!(counts.target_discarded_counts["zero_retained_paths"] > 0);
        assert_eq!(counts.actual_targets, rows.len());
    }

    #[test]
    fn blocks_do_not_depend_on_how_targets_are_divided() {
        let (robot, recipe) = (unit_robot(), recipe(Setting::General(None), 2, 3));
        let (whole, mut sum) = generate_paper_block(&robot, &recipe, 0..12);
        let (first, report) = generate_paper_block(&robot, &recipe, 0..5);
        let (second, more) = generate_paper_block(&robot, &recipe, 5..12);
        let parts: Vec<_> = first
            .into_iter()
            .chain(second)
            .map(|row| row.path)
            .collect();
        assert!(whole.len() > 10);
        assert_eq!(
            whole.into_iter().map(|row| row.path).collect::<Vec<_>>(),
            parts
        );
        let mut parts = report;
        parts += &more;
        assert_eq!(parts, std::mem::take(&mut sum));
    }
}
