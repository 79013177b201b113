//! From a path to a certified motion: smoothing its tip, correction, timing, the certificate.

use crate::motion::constraints::MotionConstraints;
use crate::motion::incumbent::Incumbent;
use crate::optimize::collision_correction::{Correction, CorrectionMemory, Corrector};
use crate::path::waypoints::Waypoints;
use crate::plan::{Certified, Failure};
use crate::problem::BENDING_SLACK_RAD;
use crate::stage_times::{StageTimes, Stopwatch};
use codes::Stage;
use pcc_model::{Configuration, SECTIONS};
use std::cell::RefCell;
use trajectory::Trajectory;

/// Clearance that corrections aim for beyond the tube, in the first and the second attempt, section lengths.
pub(super) const CORRECTION_MARGINS: [f64; MOST_CORRECTIONS] = [0.03, 0.07];
/// Clearance that smoothing a corrected path leaves beyond the tube, section lengths.
const SMOOTHED_MARGIN: f64 = 0.01;
/// How much less a path is bent along which a motion bends too far, its excess.
const BENT_LESS: f64 = 2.0;
/// Distance from the bending limit from which on a path is bent less, rad.
const NEARBY_RAD: f64 = 0.1;
/// Corrections that a path gets at most.
pub const MOST_CORRECTIONS: usize = 2;

thread_local! {
    /// Working memory of each worker, kept from request to request.
    pub(super) static CORRECTION: RefCell<CorrectionMemory> = RefCell::default();
}

/// A path after correction, and the certified motion along it or why there is none.
pub(crate) struct Delivered {
    pub(crate) path: Waypoints,
    pub(crate) outcome: Result<Certified, Failure>,
    pub(crate) times: StageTimes,
}

impl Delivered {
    /// The path and the motion along it, where there is one.
    pub(super) fn certified(self) -> Option<(Waypoints, Certified)> {
        Some((self.path, self.outcome.ok()?))
    }

    /// Whether this path makes no motion where another one might.
    fn is_refused(&self) -> bool {
        matches!(
            self.outcome,
            Err(Failure::Time | Failure::Collision | Failure::Bending)
        )
    }
}

impl MotionConstraints<'_> {
    /// Corrects, times and certifies a path (64 waypoints, radians); one that is not certified is corrected once more with a larger
    /// margin.
    ///
    /// With `smooths_tip`, as for learned paths, the tip is brought onto a smooth curve: a straight one without correction if the body
    /// is clear there, else one between the corrected path's and the straight segment's, or its own.
    ///
    /// Among moving balls the motion keeps clear of them, too, around them or after a wait.
    ///
    /// With an incumbent, a motion that is not faster is left unfinished ([`Failure::Slower`]), and so is a path as soon as corrections
    /// have made it surely too slow.
    pub(crate) fn to_trajectory(
        self,
        path: Waypoints,
        smooths_tip: bool,
        incumbent: Option<&Incumbent>,
    ) -> Delivered {
        if !self.moving.is_empty() {
            return self.among_moving(path, smooths_tip, incumbent);
        }
        let mut delivered = Delivered {
            path,
            outcome: Err(Failure::Truncated),
            times: StageTimes::default(),
        };
        let is_clear = smooths_tip && !(self.interrupt)() && self.straighten_tip(&mut delivered);
        for attempt in 0..self.corrections.clamp(1, MOST_CORRECTIONS) {
            if (self.interrupt)() {
                delivered.outcome = Err(Failure::Truncated);
                break;
            }
            let is_corrected = self.corrections > 0 && !(attempt == 0 && is_clear);
            let corrected = if is_corrected {
                self.correct(attempt, &mut delivered, incumbent)
            } else {
                Ok(())
            };
            match corrected {
                Ok(()) if is_corrected && smooths_tip => {
                    self.smooth_and_certify(&mut delivered, incumbent);
                }
                Ok(()) => self.time_and_certify(&mut delivered, incumbent),
                Err(failure) => delivered.outcome = Err(failure),
            }
            if matches!(delivered.outcome, Ok(_) | Err(Failure::Slower)) {
                break;
            }
        }
        delivered
    }

    /// Clearance beyond the robot's tube that a path should have, section lengths: the largest padding and the margin of a correction.
    pub(crate) fn room(&self) -> f64 {
        let padding = |k: usize| self.padded.tube_radii[k] - self.robot.tube_radii[k];
        CORRECTION_MARGINS[0] + (0..SECTIONS).map(padding).fold(0.0, f64::max)
    }

    /// Brings a path's tip onto a smooth curve, if the body is clear there; whether it is.
    fn straighten_tip(&self, delivered: &mut Delivered) -> bool {
        let margin = 0.5 * CORRECTION_MARGINS[0];
        let (scene, limits) = (self.scene, &self.limits);
        let Delivered { path, times, .. } = delivered;
        times.measure(Stage::Correct, || {
            self.tip_paths
                .straighten_tip(self.padded, scene, margin, limits, path)
        })
    }

    /// Pushes a path out of obstacles, unless that makes it surely slower than the incumbent.
    fn correct(
        &self,
        attempt: usize,
        delivered: &mut Delivered,
        incumbent: Option<&Incumbent>,
    ) -> Result<(), Failure> {
        let corrector = Corrector {
            robot: self.padded,
            scene: self.scene,
            moving: &[],
            kernel: self.kernel,
        };
        let is_given_up = |path: &[Configuration]| {
            incumbent
                .is_some_and(|incumbent| incumbent.beats_while_pushed(self.least_duration_s(path)))
        };
        let margin = CORRECTION_MARGINS[attempt];
        let Delivered { path, times, .. } = delivered;
        let corrected = times.measure(Stage::Correct, || {
            CORRECTION
                .with_borrow_mut(|memory| corrector.correct(margin, path, memory, is_given_up))
        });
        match corrected {
            Correction::Clear => Ok(()),
            Correction::Touching => Err(Failure::Collision),
            Correction::GivenUp => Err(Failure::Slower),
        }
    }

    /// Times and certifies a corrected path with its tip on a smooth curve, or as it is where that makes no motion.
    fn smooth_and_certify(&self, delivered: &mut Delivered, incumbent: Option<&Incumbent>) {
        let corrected = delivered.path.clone();
        let Delivered { path, times, .. } = &mut *delivered;
        times.measure(Stage::Correct, || {
            self.tip_paths
                .smooth_tip(self.padded, self.scene, SMOOTHED_MARGIN, path)
        });
        let is_smoothed = delivered.path != corrected;
        self.time_and_certify(delivered, incumbent);
        if is_smoothed && delivered.is_refused() {
            delivered.path = corrected;
            self.time_and_certify(delivered, incumbent);
        }
    }

    /// Times and certifies a path as it is, and computes the figures of the motion.
    fn time_and_certify(&self, delivered: &mut Delivered, incumbent: Option<&Incumbent>) {
        if (self.interrupt)() {
            delivered.outcome = Err(Failure::Truncated);
            return;
        }
        let certified = self.timed_and_certified(delivered, incumbent);
        let mut clock = Stopwatch::start();
        let loses = |motion: &Trajectory| {
            incumbent.is_some_and(|incumbent| incumbent.beats(motion.duration()))
        };
        delivered.outcome = match certified {
            Ok((_, motion)) if loses(&motion) => Err(Failure::Slower),
            Ok((clearance, motion)) => Ok(self.describe(motion, clearance)),
            Err(failure) => Err(failure),
        };
        delivered.times[Stage::Select] += clock.lap();
    }

    /// The motion along a path and its smallest clearance, section lengths. A path along which a motion bends a little too far is bent less.
    fn timed_and_certified(
        &self,
        delivered: &mut Delivered,
        incumbent: Option<&Incumbent>,
    ) -> Result<(f64, Trajectory), Failure> {
        let motion = self.timed_if_faster(delivered, incumbent)?;
        let certified = self.certified_clearance(&motion, &mut delivered.times);
        if certified != Err(Failure::Bending) {
            return Ok((certified?, motion));
        }
        let excess_rad = self.bending_excess_rad(&motion);
        if !(self.bending_slack_rad..BENDING_SLACK_RAD).contains(&excess_rad) {
            return Err(Failure::Bending);
        }
        self.bend_less(&mut delivered.path, BENT_LESS * excess_rad);
        let motion = self.timed_if_faster(delivered, incumbent)?;
        let clearance = self.certified_clearance(&motion, &mut delivered.times)?;
        Ok((clearance, motion))
    }

    fn timed_if_faster(
        &self,
        delivered: &mut Delivered,
        incumbent: Option<&Incumbent>,
    ) -> Result<Trajectory, Failure> {
        let Delivered { path, times, .. } = delivered;
        times.measure(Stage::Time, || self.time_if_faster(path, incumbent))
    }

    fn certified_clearance(
        &self,
        motion: &Trajectory,
        times: &mut StageTimes,
    ) -> Result<f64, Failure> {
        times.measure(Stage::Certify, || self.certify(motion))
    }

    /// Bends a path's sections less near the bending limit, by as much as `by_rad` at the limit and beyond, and smoothly less before it: a
    /// motion bends a little further between waypoints. The ends stay.
    fn bend_less(&self, path: &mut Waypoints, by_rad: f64) {
        let nearby_rad = NEARBY_RAD.min(self.robot.bending_limit);
        let nearby_from_rad = self.robot.bending_limit - nearby_rad;
        if let [_, between @ .., _] = path.as_mut_slice() {
            for waypoint in between {
                for (k, angle) in self.robot.bending_angles(waypoint).into_iter().enumerate() {
                    let nearness = smooth_step((angle - nearby_from_rad) / nearby_rad);
                    if nearness > 0.0 {
                        let scale = 1.0 - by_rad * nearness / angle;
                        waypoint[2 * k] *= scale;
                        waypoint[2 * k + 1] *= scale;
                    }
                }
            }
        }
    }

    /// Times a path, if the motion may be faster than the incumbent.
    fn time_if_faster(
        &self,
        path: &[Configuration],
        incumbent: Option<&Incumbent>,
    ) -> Result<Trajectory, Failure> {
        let is_slower =
            |duration_s| incumbent.is_some_and(|incumbent| incumbent.beats_uncertified(duration_s));
        if is_slower(self.least_duration_s(path)) {
            return Err(Failure::Slower);
        }
        let motion = self.time(path)?;
        if is_slower(motion.duration()) {
            return Err(Failure::Slower);
        }
        Ok(motion)
    }
}

/// From 0 to 1 with continuous curvature.
fn smooth_step(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x.powi(3) * (10.0 + x * (6.0 * x - 15.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{constraints, unit_robot};
    use crate::optimize::smooth_update::PushKernel;
    use crate::optimize::tip_path::TipPaths;
    use crate::path::sine_basis::SineBasis;
    use crate::path::waypoints::{WAYPOINTS, parameter};
    use collision::Scene;

    #[test]
    fn a_path_along_which_a_motion_bends_a_little_too_far_is_bent_less() {
        let (robot, scene) = (unit_robot(), Scene::default());
        let (kernel, tip_paths) = (PushKernel::new(&SineBasis::default()), TipPaths::new());
        let lax = MotionConstraints {
            corrections: 0,
            ..constraints(&robot, &scene, &kernel, &tip_paths)
        };
        let path: Waypoints = (0..WAYPOINTS)
            .map(|h| {
                let from_middle = parameter(h) - 0.5;
                let mut configuration = Configuration::zeros();
                configuration[0] = robot.bending_limit + 2e-3 - 5.0 * from_middle * from_middle;
                configuration[2] = parameter(h);
                configuration
            })
            .collect();
        let excess_rad = |constraints: &MotionConstraints| {
            let delivered = constraints.to_trajectory(path.clone(), false, None);
            let (_, certified) = delivered.certified().unwrap();
            let knots = certified.trajectory.knots();
            assert_eq!(
                [knots[0].position, knots[knots.len() - 1].position],
                [path[0], path[WAYPOINTS - 1]]
            );
            constraints.bending_excess_rad(&certified.trajectory)
        };
        let (too_far, strict) = (excess_rad(&lax), lax.bending_no_more_than(&path[0]));
        assert!((1e-4..BENDING_SLACK_RAD).contains(&too_far), "{too_far}");
        let kept = excess_rad(&strict);
        assert!(kept <= 1e-6, "{kept}");
    }

    #[test]
    fn straight_sections_of_a_robot_that_hardly_bends_stay_straight() {
        let (mut robot, scene) = ((*unit_robot()).clone(), Scene::default());
        robot.bending_limit = 0.5 * NEARBY_RAD;
        let robot = robot.to_unit().unwrap();
        let (kernel, tip_paths) = (PushKernel::new(&SineBasis::default()), TipPaths::new());
        let constraints = constraints(&robot, &scene, &kernel, &tip_paths);
        let mut path = vec![Configuration::zeros(); WAYPOINTS];
        constraints.bend_less(&mut path, 1e-3);
        assert!(
            path.iter()
                .all(|waypoint| *waypoint == Configuration::zeros())
        );
    }
}
