//! Analytic correction: smooth least-squares pushes out of obstacles and back inside the bending limits.
//!
//! Each round takes the exact nearest body points of every waypoint that are closer to an obstacle than the margin,
//! linearises the clearance by the envelope theorem (docs/robot.md "Exact geometry"), and solves for the smooth change
//! that restores it. A round looks at every fourth waypoint, and the next one at others, since neighbours want nearly the same.
//! Both ends stay exactly where they are.

use crate::optimize::smooth_update::{PushKernel, Pushes};
use crate::path::waypoints::{WAYPOINTS, project_to_limits};
use collision::{Contact, Scene};
use pcc_model::{Configuration, SECTIONS, UnitRobot};
use std::iter::once;

/// Rounds of pushes at most: a count, so that answers do not depend on time.
const ROUNDS: usize = 5;
/// First waypoints of the rounds in turn; a round considers every fourth waypoint.
const LOOKS: [usize; 4] = [0, 2, 1, 3];
/// Rounds that are compared: two with the two before them.
const LOOKS_BACK: usize = 4;
/// A correction is given up when two rounds leave more than this share of the clearance that was missing before: it is stuck.
const STALLED: f64 = 0.8;
/// Contacts of a waypoint that push it: the deepest ones.
const MOST_CONTACTS: usize = 3;
/// Bending is pulled back from this far below the limit, rad.
const LIMIT_MARGIN_RAD: f64 = 0.01;
/// Largest change of a waypoint in one round, rad.
const LARGEST_STEP_RAD: f64 = 0.5;

/// The outcome of a correction, by the waypoints alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Correction {
    /// No waypoint touches an obstacle.
    Clear,
    /// A waypoint still touches one: no motion along this path can be certified.
    Touching,
    /// The caller gave the path up after a push.
    GivenUp,
}

/// The robot and the scene for which paths are corrected.
pub(crate) struct Corrector<'a> {
    pub(crate) robot: &'a UnitRobot,
    pub(crate) scene: &'a Scene,
    /// Obstacles of each waypoint beside the scene's, those that are there at its time; none where nothing moves.
    pub(crate) moving: &'a [Scene],
    pub(crate) kernel: &'a PushKernel,
}

/// Working memory of a correction, kept between calls.
#[derive(Default)]
pub(crate) struct CorrectionMemory {
    contacts: Vec<Contact>,
    pushes: Pushes,
}

impl Corrector<'_> {
    /// Pushes a path (64 waypoints, radians) out of the scene to `margin` (section lengths) beyond the tube, until `is_given_up` says
    /// of the path that it is not wanted any more.
    pub(crate) fn correct(
        &self,
        margin: f64,
        path: &mut [Configuration],
        memory: &mut CorrectionMemory,
        is_given_up: impl Fn(&[Configuration]) -> bool,
    ) -> Correction {
        project_to_limits(self.robot, path);
        let (mut pushed, mut clear_rounds) = (0, 0);
        let mut detector = StallDetector::default();
        for round in 0.. {
            let first = 1 + LOOKS[round % LOOKS.len()];
            let deepest = self.find_pushes(margin, path, first, memory);
            let missing = 0.5 * margin - deepest;
            if missing <= 0.0 {
                clear_rounds += 1;
                if clear_rounds == LOOKS.len() {
                    return Correction::Clear;
                }
                continue;
            }
            if pushed == ROUNDS || detector.stalls(missing) {
                if deepest < 0.0 {
                    return Correction::Touching;
                }
                break;
            }
            let Some(changes) = memory.pushes.solve(self.kernel) else {
                break;
            };
            apply(&changes, path);
            project_to_limits(self.robot, path);
            if is_given_up(path) {
                return Correction::GivenUp;
            }
            (pushed, clear_rounds) = (pushed + 1, 0);
        }
        let touches = |(h, q)| {
            let mut scenes = once(self.scene).chain(self.moving.get(h));
            scenes.any(|scene| scene.clearance_at(self.robot, q) < 0.0)
        };
        if path.iter().enumerate().any(touches) {
            Correction::Touching
        } else {
            Correction::Clear
        }
    }

    /// Collects the pushes of every fourth waypoint from `first` on; returns the smallest clearance below the margin, or infinity if all
    /// are above it.
    fn find_pushes(
        &self,
        margin: f64,
        path: &[Configuration],
        first: usize,
        CorrectionMemory { contacts, pushes }: &mut CorrectionMemory,
    ) -> f64 {
        let mut deepest = f64::INFINITY;
        pushes.clear();
        let inner = path.iter().enumerate().take(WAYPOINTS - 1);
        for (h, waypoint) in inner.skip(first).step_by(LOOKS.len()) {
            for (gradient, change) in limit_pushes(self.robot, waypoint) {
                pushes.add(h, gradient, change);
            }
            let backbone = self.robot.backbone(waypoint);
            contacts.clear();
            let tube = &self.robot.tube_radii;
            for scene in once(self.scene).chain(self.moving.get(h)) {
                scene.contacts_within(&backbone, tube, margin, contacts);
            }
            if contacts.len() > MOST_CONTACTS {
                contacts.sort_by(|a, b| a.clearance.total_cmp(&b.clearance));
                contacts.truncate(MOST_CONTACTS);
            }
            for contact in contacts.iter() {
                let jacobian = backbone.point_jacobian(contact.section, contact.fraction);
                let gradient = jacobian.transpose() * contact.normal;
                pushes.add(h, gradient, margin - contact.clearance);
                deepest = deepest.min(contact.clearance);
            }
        }
        deepest
    }
}

/// For every section of a waypoint that is bent to within the limit margin: the gradient of its angle, and the change
/// wanted, rad.
pub fn limit_pushes(
    robot: &UnitRobot,
    waypoint: &Configuration,
) -> impl Iterator<Item = (Configuration, f64)> {
    let allowed = robot.bending_limit - LIMIT_MARGIN_RAD;
    let (angles, waypoint) = (robot.bending_angles(waypoint), *waypoint);
    let bent = (0..SECTIONS).filter(move |&section| angles[section] > allowed);
    bent.map(move |section| {
        let mut gradient = Configuration::zeros();
        for axis in [2 * section, 2 * section + 1] {
            gradient[axis] = waypoint[axis] / angles[section];
        }
        (gradient, allowed - angles[section])
    })
}

/// Tells when corrections do not get on any more: the clearance missing in the last rounds, the latest first.
#[derive(Default)]
struct StallDetector {
    missing: [Option<f64>; LOOKS_BACK],
}

impl StallDetector {
    /// Takes the clearance missing in a round; whether the last two rounds leave little less missing than the two before them, which
    /// considered the same waypoints.
    fn stalls(&mut self, missing: f64) -> bool {
        self.missing.rotate_right(1);
        self.missing[0] = Some(missing);
        let [Some(a), Some(b), Some(c), Some(d)] = self.missing else {
            return false;
        };
        a.max(b) > STALLED * c.max(d)
    }
}

fn apply(changes: &[Configuration; WAYPOINTS], path: &mut [Configuration]) {
    let largest = changes.iter().map(Configuration::norm).fold(0.0, f64::max);
    let scale = (LARGEST_STEP_RAD / largest.max(f64::MIN_POSITIVE)).min(1.0);
    for (waypoint, change) in path.iter_mut().zip(changes).take(WAYPOINTS - 1).skip(1) {
        *waypoint += change * scale;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::unit_robot;
    use crate::path::sine_basis::SineBasis;
    use crate::path::waypoints::straight_path;
    use collision::Ball;
    use pcc_model::Point;

    /// To a margin of 0.04.
    fn correct(
        robot: &UnitRobot,
        scene: &Scene,
        path: &mut [Configuration],
        is_given_up: impl Fn(&[Configuration]) -> bool,
    ) -> Correction {
        let kernel = PushKernel::new(&SineBasis::default());
        let corrector = Corrector {
            robot,
            scene,
            moving: &[],
            kernel: &kernel,
        };
        corrector.correct(0.04, path, &mut CorrectionMemory::default(), is_given_up)
    }

    #[test]
    fn a_path_through_a_ball_is_pushed_out_and_keeps_its_ends() {
        let robot = unit_robot();
        let start = Configuration::from_column_slice(&[0.0, 0.6, 0.0, 0.6, 0.0, 0.6]);
        let end = -start;
        let ball = Ball {
            centre: Point::new(0.15, 0.1, 2.9),
            radius: 0.3,
        };
        let scene = Scene::new(vec![ball]).unwrap();
        let mut path = straight_path(&start, &end);
        let deepest = |path: &[Configuration]| {
            path.iter()
                .map(|q| scene.clearance_at(&robot, q))
                .fold(f64::INFINITY, f64::min)
        };
        assert!(deepest(&path) < -0.2, "the straight path collides");
        let corrected = correct(&robot, &scene, &mut path, |_| false);
        assert_eq!(corrected, Correction::Clear);
        assert!(deepest(&path) >= 0.02);
        assert_eq!((path[0], path[63]), (start, end));
    }

    #[test]
    fn no_waypoint_is_overlooked() {
        let robot = unit_robot();
        let bent = |x: f64| Configuration::from_column_slice(&[x, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let ball = Ball {
            centre: robot.tip(&bent(0.6)),
            radius: 0.1,
        };
        let scene = Scene::new(vec![ball]).unwrap();
        for h in 1..WAYPOINTS - 1 {
            let mut path = vec![bent(-0.6); WAYPOINTS];
            path[h] = bent(0.6);
            correct(&robot, &scene, &mut path, |_| false);
            assert_ne!(path[h], bent(0.6), "waypoint {h} stays in the ball");
        }
    }

    #[test]
    fn a_path_is_given_up_after_the_push_that_makes_it_unwanted() {
        let robot = unit_robot();
        let start = Configuration::from_column_slice(&[0.0, 0.6, 0.0, 0.6, 0.0, 0.6]);
        let mut path = straight_path(&start, &-start);
        let tip = robot.tip(&path[32]);
        let ball = Ball {
            centre: tip + Point::new(0.1, 0.0, 0.0),
            radius: 0.3,
        };
        let scene = Scene::new(vec![ball]).unwrap();
        let asked = std::cell::Cell::new(0);
        let unwanted = |_: &[Configuration]| {
            asked.set(asked.get() + 1);
            true
        };
        let corrected = correct(&robot, &scene, &mut path, unwanted);
        assert_eq!((corrected, asked.get()), (Correction::GivenUp, 1));
    }
}
