//! The expert: paths whose tip goes straight at even speed, whole body clear, by Gauss–Newton on smooth changes.
//!
//! Minimises ∫‖p′‖² (tip energy: straight and even) + a little ∫‖ζ′‖² and ∫‖ζ″‖² + hinges on clearance and
//! bending, over the sine coefficients of the residual to the straight segment between two given ends.

use collision::{Contact, Scene};
use pcc_model::{Backbone, Configuration, DOF, UnitRobot};
use planning::{
    COEFFICIENTS, SineBasis, SmoothLeastSquares, WAYPOINTS, Waypoints, limit_pushes,
    project_to_limits, straight_path,
};
use std::f64::consts::PI;

/// Gauss–Newton rounds at most.
const ROUNDS: usize = 24;
/// Clearance asked for beyond the tube, section lengths.
const MARGIN: f64 = 0.08;
/// Weight of a waypoint's clearance deficit against the tip energy.
const CLEARANCE_WEIGHT: f64 = 20.0;
/// Weights of ∫‖ζ′‖² and ∫‖ζ″‖².
const SPEED_COST: f64 = 0.02;
const BEND_COST: f64 = 1e-4;
/// A round that improves the cost by less than this share ends the search.
const ENOUGH: f64 = 1e-3;

/// Improves a path between fixed ends; the result need not be free of collisions.
///
/// `guess` has 64 waypoints, radians, in the robot's own frame.
#[must_use]
pub(super) fn teach(robot: &UnitRobot, scene: &Scene, guess: &[Configuration]) -> Waypoints {
    let basis = SineBasis::default();
    let line = straight_path(&guess[0], &guess[WAYPOINTS - 1]);
    let mut search = Search {
        robot,
        scene,
        basis: &basis,
        line,
        contacts: Vec::new(),
    };
    let coefficients = search.descend(basis.analyse(guess));
    let mut path = search.path(&coefficients);
    project_to_limits(robot, &mut path);
    path
}

struct Search<'a> {
    robot: &'a UnitRobot,
    scene: &'a Scene,
    basis: &'a SineBasis,
    line: Waypoints,
    contacts: Vec<Contact>,
}

impl Search<'_> {
    fn path(&self, coefficients: &[f64; COEFFICIENTS]) -> Waypoints {
        self.line
            .iter()
            .enumerate()
            .map(|(h, q)| q + self.basis.change(h, coefficients))
            .collect()
    }

    /// Levenberg–Marquardt with the damping raised after a step that did not help.
    fn descend(&mut self, mut coefficients: [f64; COEFFICIENTS]) -> [f64; COEFFICIENTS] {
        let mut damping = 1e-3;
        let mut best = self.linearise(&coefficients);
        for _ in 0..ROUNDS {
            let Some(trial) = best.step(self.basis, &coefficients, damping) else {
                break;
            };
            let linear = self.linearise(&trial);
            if linear.cost < best.cost {
                let gain = 1.0 - linear.cost / best.cost;
                (coefficients, best) = (trial, linear);
                damping = (damping * 0.3_f64).max(1e-6);
                if gain < ENOUGH {
                    break;
                }
            } else {
                damping *= 8.0;
                if damping > 1e3 {
                    break;
                }
            }
        }
        coefficients
    }

    fn linearise(&mut self, coefficients: &[f64; COEFFICIENTS]) -> Linear {
        let path = self.path(coefficients);
        let backbones: Vec<Backbone> = path.iter().map(|q| self.robot.backbone(q)).collect();
        let mut linear = Linear {
            problem: SmoothLeastSquares::default(),
            cost: regular_cost(coefficients),
        };
        self.tip_rows(&backbones, &mut linear);
        for h in 1..WAYPOINTS - 1 {
            self.clearance_rows(h, &backbones[h], &mut linear);
            for (gradient, change) in limit_pushes(self.robot, &path[h]) {
                linear.problem.push(h, &gradient, change, 1.0);
            }
            linear.cost += self
                .robot
                .bending_angles(&path[h])
                .iter()
                .map(|a| (a - self.robot.bending_limit + 0.01).max(0.0).powi(2))
                .sum::<f64>();
        }
        linear
    }

    fn tip_rows(&self, backbones: &[Backbone], linear: &mut Linear) {
        let weight = (WAYPOINTS - 1) as f64;
        let jacobians: Vec<_> = backbones.iter().map(Backbone::tip_jacobian).collect();
        for h in 0..WAYPOINTS - 1 {
            let difference = backbones[h + 1].tip() - backbones[h].tip();
            linear.cost += weight * difference.norm_squared();
            for axis in 0..3 {
                let behind: Configuration = -jacobians[h].row(axis).transpose();
                let ahead: Configuration = jacobians[h + 1].row(axis).transpose();
                linear
                    .problem
                    .push_pair(h, [&behind, &ahead], -difference[axis], weight);
            }
        }
    }

    fn clearance_rows(&mut self, h: usize, backbone: &Backbone, linear: &mut Linear) {
        self.contacts.clear();
        self.scene
            .contacts_within(backbone, &self.robot.tube_radii, MARGIN, &mut self.contacts);
        for contact in &self.contacts {
            let gradient = backbone
                .point_jacobian(contact.section, contact.fraction)
                .transpose()
                * contact.normal;
            let deficit = MARGIN - contact.clearance;
            linear.problem.push(h, &gradient, deficit, CLEARANCE_WEIGHT);
            linear.cost += CLEARANCE_WEIGHT * deficit * deficit;
        }
    }
}

struct Linear {
    problem: SmoothLeastSquares,
    cost: f64,
}

impl Linear {
    fn step(
        &self,
        basis: &SineBasis,
        at: &[f64; COEFFICIENTS],
        damping: f64,
    ) -> Option<[f64; COEFFICIENTS]> {
        let diagonal = std::array::from_fn(|i| regular_weight(i) + damping);
        let pull = std::array::from_fn(|i| -regular_weight(i) * at[i]);
        let change = self.problem.solve(basis, &diagonal, &pull)?;
        Some(std::array::from_fn(|i| at[i] + change[i]))
    }
}

fn regular_weight(index: usize) -> f64 {
    let frequency = (index / DOF + 1) as f64 * PI;
    0.5 * (SPEED_COST * frequency.powi(2) + BEND_COST * frequency.powi(4))
}

fn regular_cost(coefficients: &[f64; COEFFICIENTS]) -> f64 {
    coefficients
        .iter()
        .enumerate()
        .map(|(i, c)| regular_weight(i) * c * c)
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::unit_robot;

    fn tip_length(robot: &UnitRobot, path: &[Configuration]) -> f64 {
        path.windows(2)
            .map(|w| (robot.tip(&w[1]) - robot.tip(&w[0])).norm())
            .sum()
    }

    #[test]
    fn the_expert_shortens_the_tip_path_of_a_straight_segment() {
        let robot = unit_robot();
        let start = Configuration::from_column_slice(&[0.9, -0.4, -1.0, 0.6, 0.4, 1.2]);
        let end = Configuration::from_column_slice(&[-0.8, 0.9, 0.3, -1.1, 1.0, -0.3]);
        let straight = straight_path(&start, &end);
        let taught = teach(&robot, &Scene::new(vec![]).unwrap(), &straight);
        let distance = (robot.tip(&end) - robot.tip(&start)).norm();
        assert!(
            tip_length(&robot, &straight) > 1.1 * distance,
            "there is something to gain"
        );
        assert!(tip_length(&robot, &taught) < 1.03 * distance);
        assert!((taught[0] - start).norm() < 1e-12 && (taught[63] - end).norm() < 1e-12);
    }
}
