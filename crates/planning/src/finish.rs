//! From a path to a motion: correction, time allocation, the certificate of the curve that is executed, its figures.

use crate::correction::{Correction, CorrectionMemory, Corrector};
use crate::incumbent::Rival;
use crate::least_duration::least_duration_s;
use crate::metrics::{CLEARANCE_TOLERANCE, PathMetrics};
use crate::path::{Waypoints, resample};
use crate::plan::{Certified, Failure};
use crate::problem::BENDING_SLACK_RAD;
use crate::pushes::PushKernel;
use crate::request::Interrupt;
use crate::stage_times::{StageTimes, Stopwatch};
use crate::straighten::TipCurves;
use collision::{Scene, certified_clearance, certify_polyline};
use pcc_model::{Configuration, Robot, SECTIONS, TendonLimits};
use std::cell::RefCell;
use trajectory::{Knot, ParameterizationOptions, TimeParameterizer, Trajectory};

/// Clearance that corrections aim for beyond the tube, in the first and the second attempt, section lengths.
const CORRECTION_MARGINS: [f64; MOST_CORRECTIONS] = [0.03, 0.07];
/// Clearance that smoothing a corrected path leaves beyond the tube, section lengths.
const SMOOTHED_MARGIN: f64 = 0.01;
/// Smooth paths beside a polyline that are tried: where the smoothest fail, others seldom serve.
const BESIDE: usize = 2;
/// Knots of a straight leg at least.
const LEAST_KNOTS_OF_A_LEG: usize = 8;
/// Corrections that a path gets at most.
pub const MOST_CORRECTIONS: usize = 2;

thread_local! {
    /// Each worker's memory, kept from request to request.
    static MEMORY: RefCell<Memory> = RefCell::default();
}

#[derive(Default)]
struct Memory {
    correction: CorrectionMemory,
    parameterizer: TimeParameterizer,
}

/// What a motion must keep, and how far it may be corrected to that end.
pub(crate) struct Demands<'a> {
    pub(crate) robot: &'a Robot,
    /// The robot with the tubes that must keep clear.
    pub(crate) grown: &'a Robot,
    pub(crate) scene: &'a Scene,
    pub(crate) kernel: &'a PushKernel,
    pub(crate) curves: &'a TipCurves,
    pub(crate) limits: TendonLimits,
    pub(crate) knots: usize,
    pub(crate) corrections: usize,
    pub(crate) interrupt: Interrupt<'a>,
}

/// A path on its way to a motion.
pub(crate) struct Finished {
    pub(crate) path: Waypoints,
    pub(crate) outcome: Result<Certified, Failure>,
    pub(crate) laps: StageTimes,
}

impl Finished {
    /// Whether this path makes no motion where another one might.
    fn is_refused_beside(&self, other: &[Configuration]) -> bool {
        let is_refused = matches!(
            self.outcome,
            Err(Failure::Time | Failure::Collision | Failure::Bending)
        );
        is_refused && self.path != other
    }
}

/// Adds a motion that begins where the one before comes to rest.
pub(crate) fn append(knots: &mut Vec<Knot>, motion: &Trajectory) {
    let begin = knots.pop().map_or(0.0, |knot| knot.time);
    knots.extend(motion.knots().iter().map(|knot| Knot {
        time: knot.time + begin,
        ..*knot
    }));
}

impl Demands<'_> {
    /// Corrects, times and certifies a path; what does not certify is corrected once more with a larger margin. The tip of a
    /// rough path is drawn onto a smooth curve: a straight one without correction if that is clear, else one beside the
    /// corrected path.
    ///
    /// A motion that does not beat its rival is left unfinished, and so is a path that a push has made surely too slow.
    pub(crate) fn finish(
        &self,
        path: Waypoints,
        is_rough: bool,
        rival: Option<&Rival>,
    ) -> Finished {
        let mut finished = Finished {
            path,
            outcome: Err(Failure::Truncated),
            laps: StageTimes::default(),
        };
        let is_clear = is_rough && !(self.interrupt)() && self.straighten(&mut finished);
        for attempt in 0..self.corrections.clamp(1, MOST_CORRECTIONS) {
            if (self.interrupt)() {
                finished.outcome = Err(Failure::Truncated);
                break;
            }
            let is_corrected = self.corrections > 0 && !(attempt == 0 && is_clear);
            let corrected = if is_corrected {
                self.correct(attempt, &mut finished, rival)
            } else {
                Ok(())
            };
            match corrected {
                Ok(()) if is_corrected && is_rough => self.deliver_smooth(&mut finished, rival),
                Ok(()) => self.deliver(&mut finished, rival),
                Err(failure) => finished.outcome = Err(failure),
            }
            if matches!(finished.outcome, Ok(_) | Err(Failure::Slower)) {
                break;
            }
        }
        finished
    }

    /// Clearance beyond the robot's tube that a path should have, section lengths.
    pub(crate) fn room(&self) -> f64 {
        let growth = |k: usize| self.grown.tube_radii[k] - self.robot.tube_radii[k];
        CORRECTION_MARGINS[0] + (0..SECTIONS).map(growth).fold(0.0, f64::max)
    }

    /// Draws a sampled path's tip onto a smooth curve, if that leaves nothing to correct; whether it does.
    fn straighten(&self, finished: &mut Finished) -> bool {
        let mut clock = Stopwatch::start();
        let margin = 0.5 * CORRECTION_MARGINS[0];
        let (scene, limits) = (self.scene, &self.limits);
        let path = &mut finished.path;
        let is_clear = self
            .curves
            .straighten(self.grown, scene, margin, limits, path);
        finished.laps.correct += clock.lap();
        is_clear
    }

    /// Draws a path's tip onto a smooth curve beside its way; whether there is one.
    fn smooth(&self, path: &mut [Configuration]) -> bool {
        self.curves
            .smooth(self.grown, self.scene, SMOOTHED_MARGIN, path)
    }

    /// Pushes a path out of obstacles, unless that makes it surely slower than its rival.
    fn correct(
        &self,
        attempt: usize,
        finished: &mut Finished,
        rival: Option<&Rival>,
    ) -> Result<(), Failure> {
        let mut clock = Stopwatch::start();
        let corrector = Corrector {
            robot: self.grown,
            scene: self.scene,
            kernel: self.kernel,
        };
        let corrected = MEMORY.with_borrow_mut(|memory| {
            corrector.correct(
                CORRECTION_MARGINS[attempt],
                &mut finished.path,
                &mut memory.correction,
                |path| rival.is_some_and(|rival| rival.stops_pushing(self.least_s(path))),
            )
        });
        finished.laps.correct += clock.lap();
        match corrected {
            Correction::Clear => Ok(()),
            Correction::Touching => Err(Failure::Collision),
            Correction::GivenUp => Err(Failure::Slower),
        }
    }

    /// Delivers a corrected path on a smooth curve beside its way, or as it is where that is refused.
    fn deliver_smooth(&self, finished: &mut Finished, rival: Option<&Rival>) {
        let corrected = finished.path.clone();
        let mut clock = Stopwatch::start();
        self.smooth(&mut finished.path);
        finished.laps.correct += clock.lap();
        self.deliver(finished, rival);
        if finished.is_refused_beside(&corrected) {
            finished.path = corrected;
            self.deliver(finished, rival);
        }
    }

    /// Times, certifies and describes a path as it is.
    fn deliver(&self, finished: &mut Finished, rival: Option<&Rival>) {
        if (self.interrupt)() {
            finished.outcome = Err(Failure::Truncated);
            return;
        }
        let mut clock = Stopwatch::start();
        let timed = self.time_winner(&finished.path, rival);
        finished.laps.time += clock.lap();
        let certified = timed.and_then(|motion| Ok((self.certify(&motion)?, motion)));
        finished.laps.certify += clock.lap();
        let loses = |motion: &Trajectory| rival.is_some_and(|rival| rival.stops(motion.duration()));
        finished.outcome = match certified {
            Ok((_, motion)) if loses(&motion) => Err(Failure::Slower),
            Ok((clearance, motion)) => Ok(self.describe(motion, clearance)),
            Err(failure) => Err(failure),
        };
        finished.laps.select += clock.lap();
    }

    /// Times a path, if the motion may beat its rival.
    fn time_winner(
        &self,
        path: &[Configuration],
        rival: Option<&Rival>,
    ) -> Result<Trajectory, Failure> {
        let is_slower = |duration_s| rival.is_some_and(|rival| rival.stops_uncertified(duration_s));
        if is_slower(self.least_s(path)) {
            return Err(Failure::Slower);
        }
        let motion = self.time(path)?;
        if is_slower(motion.duration()) {
            return Err(Failure::Slower);
        }
        Ok(motion)
    }

    fn least_s(&self, path: &[Configuration]) -> f64 {
        least_duration_s(self.robot, &self.limits, path)
    }

    /// A motion that is certified, with its figures of merit.
    fn certified(&self, trajectory: Trajectory) -> Result<Certified, Failure> {
        let clearance = self.certify(&trajectory)?;
        Ok(self.describe(trajectory, clearance))
    }

    /// A certified motion with its figures of merit; `clearance` in section lengths.
    fn describe(&self, trajectory: Trajectory, clearance: f64) -> Certified {
        let metrics = PathMetrics::of(self.robot, &trajectory, clearance);
        Certified {
            trajectory: trajectory.into(),
            metrics,
        }
    }

    /// Times a path of 64 waypoints from rest to rest.
    fn time(&self, path: &[Configuration]) -> Result<Trajectory, Failure> {
        self.parameterize(path, self.knots)
    }

    fn parameterize(&self, path: &[Configuration], knots: usize) -> Result<Trajectory, Failure> {
        let options = ParameterizationOptions {
            knots,
            ..ParameterizationOptions::default()
        };
        let tendons = &self.robot.tendons;
        MEMORY
            .with_borrow_mut(|memory| {
                memory
                    .parameterizer
                    .parameterize(path, tendons, &self.limits, &options)
            })
            .map_err(|_| Failure::Time)
    }

    /// Certifies the executed curve: whole body, whole motion, bending; its smallest clearance, section lengths.
    pub(crate) fn certify(&self, trajectory: &Trajectory) -> Result<f64, Failure> {
        if !self.keeps_bending(trajectory) {
            return Err(Failure::Bending);
        }
        let (robot, grown, scene) = (self.robot, self.grown, self.scene);
        certified_clearance(robot, grown, scene, trajectory, CLEARANCE_TOLERANCE)
            .ok_or(Failure::Collision)
    }

    /// The Bézier control points bound the curve, since the allowed bending is convex.
    fn keeps_bending(&self, trajectory: &Trajectory) -> bool {
        trajectory.segments().all(|s| {
            s.control
                .iter()
                .all(|q| self.robot.limit_excess(q) <= BENDING_SLACK_RAD)
        })
    }

    /// A motion between the ends of a certified polyline along a smooth path beside it, which is pushed out of what it touches: the
    /// smoothest one that can be timed and certified.
    pub(crate) fn beside(&self, polyline: &[Configuration]) -> Option<(Waypoints, Certified)> {
        let smoothed = self.curves.calmed(resample(polyline)).take(BESIDE);
        let mut finished = smoothed.map(|path| self.finish(path, false, None));
        finished.find_map(|finished| Some((finished.path, finished.outcome.ok()?)))
    }

    /// A motion along a path that gets what a sampled one gets: its tip drawn onto a smooth curve, corrected, smoothed after that, and
    /// delivered as corrected where the smoothed one is refused.
    pub(crate) fn smoothed(&self, path: Waypoints) -> Option<(Waypoints, Certified)> {
        let finished = self.finish(path, true, None);
        Some((finished.path, finished.outcome.ok()?))
    }

    /// Turns the first of these ways along a certified polyline that certifies into a motion; where there is none, the motion
    /// rests at each corner.
    pub(crate) fn along(
        &self,
        polyline: &[Configuration],
        ways: impl IntoIterator<Item = Waypoints>,
    ) -> Option<(Waypoints, Certified)> {
        let motion = |way: &Waypoints| self.certified(self.time(way)?);
        let first = ways
            .into_iter()
            .take_while(|_| !(self.interrupt)())
            .find_map(|way| Some((motion(&way).ok()?, way)));
        let (motion, way) = first.or_else(|| {
            let rests = !(self.interrupt)();
            let motion = rests.then(|| self.rest_at_corners(polyline).ok());
            Some((motion.flatten()?, resample(polyline)))
        })?;
        Some((way, motion))
    }

    fn rest_at_corners(&self, polyline: &[Configuration]) -> Result<Certified, Failure> {
        if !certify_polyline(self.grown, self.scene, polyline).is_free() {
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
        self.certified(Trajectory::new(knots).map_err(|_| Failure::Time)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::basis::SineBasis;
    use crate::fixtures::unit_robot;
    use collision::Ball;
    use nalgebra::{Rotation3, Vector3};
    use std::sync::atomic::{AtomicUsize, Ordering};

    fn demands<'a>(
        robot: &'a Robot,
        scene: &'a Scene,
        kernel: &'a PushKernel,
        curves: &'a TipCurves,
    ) -> Demands<'a> {
        Demands {
            robot,
            grown: robot,
            scene,
            kernel,
            curves,
            limits: robot.tendon_limits,
            knots: 96,
            corrections: MOST_CORRECTIONS,
            interrupt: &|| false,
        }
    }

    /// Least clearance of 100 points a section over 2000 instants, by their distances alone; at most 1e-3 above the true one. The
    /// arcs are written down again from `docs/robot.md`, for sections of length 1 and tubes of radius 0.2.
    fn sampled_clearance(ball: &Ball, motion: &Trajectory) -> f64 {
        let mut least = f64::INFINITY;
        for shape in motion.sample(2000) {
            let (mut origin, mut frame) = (Vector3::zeros(), Rotation3::identity());
            for section in 0..3 {
                let axis = Vector3::new(shape[2 * section], shape[2 * section + 1], 0.0);
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
        let (kernel, curves) = (PushKernel::new(&SineBasis::new()), TipCurves::new());
        let demands = demands(&robot, &scene, &kernel, &curves);
        let polyline = [bent(-0.5, 0.0), bent(0.0, 0.6), bent(0.5, 0.0)];
        let (path, beside) = demands.beside(&polyline).unwrap();
        assert_eq!([path[0], path[path.len() - 1]], [polyline[0], polyline[2]]);
        let sampled = sampled_clearance(&ball, &beside.trajectory);
        let certified = beside.metrics.clearance;
        assert!(certified > 0.0, "{certified}");
        let above = sampled - certified;
        assert!((-1e-4..2e-3).contains(&above), "{certified}, {sampled}");
        let (_, along) = demands.along(&polyline, [resample(&polyline)]).unwrap();
        let [beside_s, along_s] = [beside, along].map(|motion| motion.metrics.duration_s);
        assert!(beside_s < 0.9 * along_s, "{beside_s} {along_s}");
    }

    #[test]
    fn a_motion_that_is_made_is_not_lost_to_an_interrupt_after_it() {
        let (robot, scene) = (unit_robot(), Scene::default());
        let (kernel, curves) = (PushKernel::new(&SineBasis::new()), TipCurves::new());
        let polyline = [0.0, 0.3].map(Configuration::repeat);
        let (asked, most) = (AtomicUsize::new(0), AtomicUsize::new(usize::MAX));
        let interrupt = || asked.fetch_add(1, Ordering::Relaxed) >= most.load(Ordering::Relaxed);
        let demands = Demands {
            interrupt: &interrupt,
            ..demands(&robot, &scene, &kernel, &curves)
        };
        let is_made = || demands.beside(&polyline).is_some();
        assert!(is_made());
        most.store(asked.swap(0, Ordering::Relaxed), Ordering::Relaxed);
        assert!(is_made(), "nobody asks once it is made");
        most.store(0, Ordering::Relaxed);
        assert!(!is_made());
    }

    #[test]
    fn a_motion_that_rests_at_its_corners_has_the_knots_of_a_motion_or_is_none() {
        let (robot, scene) = (unit_robot(), Scene::default());
        let kernel = PushKernel::new(&SineBasis::new());
        let curves = TipCurves::new();
        let demands = demands(&robot, &scene, &kernel, &curves);
        let zigzag = |edges: usize| -> Vec<Configuration> {
            let corner = |i: usize| Configuration::repeat([0.0, 0.3][i % 2] + 1e-3 * i as f64);
            (0..=edges).map(corner).collect()
        };
        let few = demands.rest_at_corners(&zigzag(12)).unwrap().trajectory;
        assert!((12..=96).contains(&few.knots().len()));
        let rests = few.knots().iter().filter(|k| k.velocity.norm() == 0.0);
        assert_eq!(rests.count(), 13, "it rests at every corner");
        assert_eq!(
            demands.rest_at_corners(&zigzag(120)).err(),
            Some(Failure::Time)
        );
    }
}
