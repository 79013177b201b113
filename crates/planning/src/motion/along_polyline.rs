//! Motions along and beside polylines that a search has certified.

use crate::motion::constraints::MotionConstraints;
use crate::motion::path_to_trajectory::Delivered;
use crate::path::waypoints::{Waypoints, resample};
use crate::plan::{Certified, Failure};
use collision::certify_polyline;
use pcc_model::Configuration;
use trajectory::{Knot, Trajectory};

/// Smooth paths beside a polyline that are tried: where the smoothest fail, others seldom serve.
const BESIDE: usize = 2;
/// Knots of a straight leg at least.
const LEAST_KNOTS_OF_A_LEG: usize = 8;

/// Adds a motion that begins where the one before comes to rest.
pub(crate) fn append(knots: &mut Vec<Knot>, motion: &Trajectory) {
    let begin = knots.pop().map_or(0.0, |knot| knot.time);
    knots.extend(motion.knots().iter().map(|knot| Knot {
        time: knot.time + begin,
        ..*knot
    }));
}

impl MotionConstraints<'_> {
    /// A motion between the ends of a certified polyline along a smooth path beside it, which is pushed out of what it touches: the
    /// smoothest one that can be timed and certified.
    pub(crate) fn beside(&self, polyline: &[Configuration]) -> Option<(Waypoints, Certified)> {
        let smoothed = self.tip_paths.smoothed(resample(polyline)).take(BESIDE);
        let mut delivered = smoothed.map(|path| self.to_trajectory(path, false, None));
        delivered.find_map(Delivered::certified)
    }

    /// A motion along a path that gets what a learned one gets: its tip is brought onto a smooth curve, it is corrected, smoothed after
    /// that, and taken as corrected where the smoothed one makes no motion.
    pub(crate) fn like_a_learned_path(&self, path: Waypoints) -> Option<(Waypoints, Certified)> {
        self.to_trajectory(path, true, None).certified()
    }

    /// A motion along the first of these paths for which it is certified; where there is none, a motion along the certified polyline
    /// that rests at each corner.
    pub(crate) fn along(
        &self,
        polyline: &[Configuration],
        paths: impl IntoIterator<Item = Waypoints>,
    ) -> Option<(Waypoints, Certified)> {
        let motion = |path: &Waypoints| self.certified_or_waiting(self.time(path)?);
        let first = paths
            .into_iter()
            .take_while(|_| !(self.interrupt)())
            .find_map(|path| Some((motion(&path).ok()?, path)));
        let (motion, path) = first.or_else(|| {
            let rests = !(self.interrupt)();
            let motion = rests.then(|| self.rest_at_corners(polyline).ok());
            Some((motion.flatten()?, resample(polyline)))
        })?;
        Some((path, motion))
    }

    /// A motion along the edges of a polyline that rests at each corner.
    fn rest_at_corners(&self, polyline: &[Configuration]) -> Result<Certified, Failure> {
        if !certify_polyline(self.padded, self.scene, polyline).is_free() {
            return Err(Failure::Collision);
        }
        let edges = polyline.len() - 1;
        let knots_of_a_leg = (self.knots / edges).max(LEAST_KNOTS_OF_A_LEG);
        let mut knots: Vec<Knot> = Vec::new();
        for edge in polyline.windows(2) {
            append(&mut knots, &self.parameterize(edge, knots_of_a_leg)?);
        }
        if knots.len() > self.knots {
            return Err(Failure::Time);
        }
        self.certified_or_waiting(Trajectory::new(knots).map_err(|_| Failure::Time)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{constraints, unit_robot};
    use crate::optimize::smooth_update::PushKernel;
    use crate::optimize::tip_path::TipPaths;
    use crate::path::sine_basis::SineBasis;
    use collision::{Ball, Scene};
    use nalgebra::{Rotation3, Vector3};
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// Least clearance of 100 points a section over 2000 instants, by their distances alone; at most 1e-3 above the true one. The
    /// arcs are written down again from `docs/robot.md`, for sections of length 1 and tubes of radius 0.2.
    fn sampled_clearance(ball: &Ball, motion: &Trajectory) -> f64 {
        let mut least = f64::INFINITY;
        for configuration in motion.sample(2000) {
            let (mut origin, mut frame) = (Vector3::zeros(), Rotation3::identity());
            for section in 0..3 {
                let axis = Vector3::new(
                    configuration[2 * section],
                    configuration[2 * section + 1],
                    0.0,
                );
                for place in 0..=100 {
                    let point = origin + frame * arc_point(axis, f64::from(place) / 100.0);
                    least = least.min((point - ball.centre).norm() - ball.radius - 0.2);
                }
                origin += frame * arc_point(axis, 1.0);
                frame *= Rotation3::new(axis);
            }
        }
        least
    }

    /// A point of an arc of length 1 that bends about `axis`: the integral of the turned z axis.
    fn arc_point(axis: Vector3<f64>, fraction: f64) -> Vector3<f64> {
        let angle = axis.norm();
        let Some(direction) = axis.try_normalize(1e-9) else {
            return Vector3::new(0.0, 0.0, fraction);
        };
        let (sin, cos) = (angle * fraction).sin_cos();
        (Vector3::z() * sin + direction.cross(&Vector3::z()) * (1.0 - cos)) / angle
    }

    #[test]
    fn a_motion_beside_a_polyline_is_faster_than_along_it_and_keeps_clear() {
        let robot = unit_robot();
        let bent = |x: f64, y: f64| Configuration::from_column_slice(&[x, y, 0.0, 0.0, 0.0, 0.0]);
        let ball = Ball {
            centre: robot.tip(&bent(0.0, 0.0)),
            radius: 0.3,
        };
        let scene = Scene::new(vec![ball]).unwrap();
        let (kernel, tip_paths) = (PushKernel::new(&SineBasis::default()), TipPaths::new());
        let constraints = constraints(&robot, &scene, &kernel, &tip_paths);
        let polyline = [bent(-0.5, 0.0), bent(0.0, 0.6), bent(0.5, 0.0)];
        let (path, beside) = constraints.beside(&polyline).unwrap();
        assert_eq!([path[0], path[path.len() - 1]], [polyline[0], polyline[2]]);
        let sampled = sampled_clearance(&ball, &beside.trajectory);
        let certified = beside.metrics.clearance;
        assert!(certified > 0.0, "{certified}");
        let above = sampled - certified;
        assert!((-1e-4..2e-3).contains(&above), "{certified}, {sampled}");
        let (_, along) = constraints.along(&polyline, [resample(&polyline)]).unwrap();
        let [beside_s, along_s] = [beside, along].map(|motion| motion.metrics.duration_s);
        assert!(beside_s < 0.9 * along_s, "{beside_s} {along_s}");
    }

    #[test]
    fn a_motion_that_is_made_is_not_lost_to_an_interrupt_after_it() {
        let (robot, scene) = (unit_robot(), Scene::default());
        let (kernel, tip_paths) = (PushKernel::new(&SineBasis::default()), TipPaths::new());
        let polyline = [0.0, 0.3].map(Configuration::repeat);
        let (asked, most) = (AtomicUsize::new(0), AtomicUsize::new(usize::MAX));
        let interrupt = || asked.fetch_add(1, Ordering::Relaxed) >= most.load(Ordering::Relaxed);
        let constraints = MotionConstraints {
            interrupt: &interrupt,
            ..constraints(&robot, &scene, &kernel, &tip_paths)
        };
        let is_made = || constraints.beside(&polyline).is_some();
        assert!(is_made());
        most.store(asked.swap(0, Ordering::Relaxed), Ordering::Relaxed);
        assert!(is_made(), "nobody asks once it is made");
        most.store(0, Ordering::Relaxed);
        assert!(!is_made());
    }

    #[test]
    fn a_motion_that_rests_at_its_corners_has_the_knots_of_a_motion_or_is_none() {
        let (robot, scene) = (unit_robot(), Scene::default());
        let kernel = PushKernel::new(&SineBasis::default());
        let tip_paths = TipPaths::new();
        let constraints = constraints(&robot, &scene, &kernel, &tip_paths);
        let zigzag = |edges: usize| -> Vec<Configuration> {
            let corner = |i: usize| Configuration::repeat([0.0, 0.3][i % 2] + 1e-3 * i as f64);
            (0..=edges).map(corner).collect()
        };
        let few = constraints.rest_at_corners(&zigzag(12)).unwrap().trajectory;
        assert!((12..=96).contains(&few.knots().len()));
        let rests = few.knots().iter().filter(|k| k.velocity.norm() == 0.0);
        assert_eq!(rests.count(), 13, "it rests at every corner");
        assert_eq!(
            constraints.rest_at_corners(&zigzag(120)).err(),
            Some(Failure::Time)
        );
    }
}
