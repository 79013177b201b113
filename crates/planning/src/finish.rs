//! From a path to a motion: time allocation, then the certificate of the curve that is executed.

use crate::path::{Waypoints, resample};
use crate::plan::Failure;
use crate::problem::BENDING_SLACK_RAD;
use collision::{Scene, certify_polyline, certify_trajectory};
use pcc_model::{Configuration, Robot, TendonLimits};
use trajectory::{AllocationOptions, Knot, MAX_KNOTS, Trajectory, allocate};

/// What a motion must keep.
pub(crate) struct Demands<'a> {
    pub(crate) robot: &'a Robot,
    pub(crate) scene: &'a Scene,
    pub(crate) limits: TendonLimits,
    pub(crate) knots: usize,
    pub(crate) growth: f64,
}

impl Demands<'_> {
    /// Times a path of 64 waypoints from rest to rest.
    pub(crate) fn time(&self, path: &[Configuration]) -> Result<Trajectory, Failure> {
        let options = AllocationOptions {
            knots: self.knots,
            ..AllocationOptions::default()
        };
        allocate(path, &self.robot.tendons, &self.limits, &options).map_err(|_| Failure::Time)
    }

    /// Certifies the executed curve: whole body, whole motion, bending.
    pub(crate) fn certify(&self, trajectory: &Trajectory) -> Result<(), Failure> {
        if !self.keeps_bending(trajectory) {
            return Err(Failure::Bending);
        }
        let verdict = certify_trajectory(self.robot, self.scene, trajectory, 0.0, self.growth);
        if verdict.is_free() {
            Ok(())
        } else {
            Err(Failure::Collision)
        }
    }

    /// The Bézier control points bound the curve, since the allowed bending is convex.
    fn keeps_bending(&self, trajectory: &Trajectory) -> bool {
        trajectory.segments().all(|s| {
            s.control
                .iter()
                .all(|q| self.robot.limit_excess(q) <= BENDING_SLACK_RAD)
        })
    }

    /// Turns a certified polyline into a motion: rounded where that certifies, else resting at each corner.
    pub(crate) fn follow(
        &self,
        polyline: &[Configuration],
    ) -> Result<(Waypoints, Trajectory), Failure> {
        let path = resample(polyline);
        let rounded = self.time(&path).and_then(|t| self.certify(&t).map(|()| t));
        rounded
            .or_else(|_| self.rest_at_corners(polyline))
            .map(|t| (path, t))
    }

    fn rest_at_corners(&self, polyline: &[Configuration]) -> Result<Trajectory, Failure> {
        if !certify_polyline(self.robot, self.scene, polyline).is_free() {
            return Err(Failure::Collision);
        }
        let edges = polyline.len() - 1;
        let options = AllocationOptions {
            knots: (self.knots / edges).max(8),
            ..AllocationOptions::default()
        };
        let mut knots: Vec<Knot> = Vec::new();
        for edge in polyline.windows(2) {
            let leg = allocate(edge, &self.robot.tendons, &self.limits, &options)
                .map_err(|_| Failure::Time)?;
            let begin = knots.pop().map_or(0.0, |k| k.time);
            knots.extend(leg.knots().iter().map(|k| Knot {
                time: k.time + begin,
                ..*k
            }));
        }
        if knots.len() > MAX_KNOTS {
            return Err(Failure::Time);
        }
        let trajectory = Trajectory::new(knots).map_err(|_| Failure::Time)?;
        self.certify(&trajectory).map(|()| trajectory)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenes::unit_robot;

    #[test]
    fn a_motion_that_rests_at_its_corners_has_the_knots_of_a_motion_or_is_none() {
        let (robot, scene) = (unit_robot(), Scene::default());
        let demands = Demands {
            robot: &robot,
            scene: &scene,
            limits: robot.tendon_limits,
            knots: 96,
            growth: 0.0,
        };
        let zigzag = |edges: usize| -> Vec<Configuration> {
            let corner = |i: usize| Configuration::repeat([0.0, 0.3][i % 2] + 1e-3 * i as f64);
            (0..=edges).map(corner).collect()
        };
        let few = demands.rest_at_corners(&zigzag(12)).unwrap();
        assert!((12..=MAX_KNOTS).contains(&few.knots().len()));
        let rests = few.knots().iter().filter(|k| k.velocity.norm() == 0.0);
        assert_eq!(rests.count(), 13, "it rests at every corner");
        assert_eq!(demands.rest_at_corners(&zigzag(120)), Err(Failure::Time));
    }
}
