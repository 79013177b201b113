//! Motions among balls that move: a path that is certified among the obstacles at rest is timed; where a ball comes to the robot's place,
//! it is corrected against where the balls will be, or passed later or more slowly, when the ball has gone by.

use crate::motion::constraints::MotionConstraints;
use crate::motion::incumbent::Incumbent;
use crate::motion::path_to_trajectory::{CORRECTION, CORRECTION_MARGINS, Delivered};
use crate::moving_obstacles::USUAL_STOP_S;
use crate::optimize::collision_correction::{Correction, Corrector};
use crate::path::waypoints::{WAYPOINTS, Waypoints};
use crate::plan::{Certified, Failure};
use codes::Stage;
use collision::{Cover, MovingBall, Scene, certify_moving};
use pcc_model::{Configuration, TendonLimits};
use std::sync::Arc;
use trajectory::{Knot, Trajectory};

/// Corrections against where the balls will be, each by the times of the motion along the path before it.
const ROUNDS: usize = 3;
/// Step between the times for which the robot waits at the start, s.
const WAIT_STEP_S: f64 = 0.25;
/// Steps that the robot waits at most.
const WAIT_STEPS: u32 = 24;
/// Halvings of the step after which a motion can begin.
const WAIT_HALVINGS: usize = 3;
/// Longest wait at the start, s.
const LONGEST_WAIT_S: f64 = WAIT_STEP_S * WAIT_STEPS as f64;
/// Shares of the tendon limits of slower motions along the same path, in the order in which they are tried.
const SLOWER: [f64; 3] = [0.7, 0.5, 0.35];
/// Samples of a motion by which the times of its waypoints are known.
const SAMPLES: usize = 4 * WAYPOINTS;

/// A motion and the path that it follows.
type Motion = (Waypoints, Certified);

impl MotionConstraints<'_> {
    /// Makes a motion of a path as among obstacles at rest, then one that keeps clear of moving balls, too: the fastest of one along
    /// the path, one around the balls and one that waits; a slower one where these are not certified.
    pub(super) fn among_moving(
        &self,
        path: Waypoints,
        smooths_tip: bool,
        incumbent: Option<&Incumbent>,
    ) -> Delivered {
        let resting = Self {
            knots: self.knots.saturating_sub(1),
            ..self.among_resting()
        };
        let mut delivered = resting.to_trajectory(path, smooths_tip, incumbent);
        let Ok(certified) = &delivered.outcome else {
            return delivered;
        };
        let motion = Arc::clone(&certified.trajectory);
        let Delivered {
            path,
            outcome,
            times,
        } = &mut delivered;
        let found = times.measure(Stage::Correct, || self.past_the_balls(path, &motion));
        let loses = |motion: &Certified| {
            incumbent.is_some_and(|incumbent| incumbent.beats(motion.metrics.duration_s))
        };
        *outcome = match found {
            Some((_, motion)) if loses(&motion) => Err(Failure::Slower),
            Some((along, motion)) => {
                *path = along;
                Ok(motion)
            }
            None if (self.interrupt)() => Err(Failure::Truncated),
            None => Err(Failure::Collision),
        };
        delivered
    }

    /// The motion if it is certified, or else one that is when it begins later.
    pub(super) fn certified_or_waiting(&self, motion: Trajectory) -> Result<Certified, Failure> {
        if self.moving.is_empty() {
            return self.certified(motion);
        }
        let waiting = |failure| self.waiting(&motion).ok_or(failure);
        self.certified(motion.clone()).or_else(waiting)
    }

    /// The fastest motion that keeps clear of the balls, along a path whose `motion` is certified among the obstacles at rest or beside it.
    fn past_the_balls(&self, path: &Waypoints, motion: &Trajectory) -> Option<Motion> {
        let along = |motion| (path.clone(), motion);
        if !self.stands_clear(motion, LONGEST_WAIT_S) {
            return None;
        }
        if let Ok(direct) = self.certified(motion.clone()) {
            return Some(along(direct));
        }
        let waiting = self.waiting(motion).map(along);
        let around = self.around(path, motion);
        let both = waiting.into_iter().chain(around);
        both.min_by(|a, b| a.1.metrics.duration_s.total_cmp(&b.1.metrics.duration_s))
            .or_else(|| self.slower(path).map(along))
    }

    /// A motion around the balls: the path is corrected against where they will be, by the times of the motion along it, and timed anew.
    fn around(&self, path: &Waypoints, motion: &Trajectory) -> Option<Motion> {
        let mut path = path.clone();
        let mut motion = motion.clone();
        for round in 0..ROUNDS {
            if (self.interrupt)() {
                return None;
            }
            let places = self.places(&path, &motion);
            let corrector = Corrector {
                robot: self.padded,
                scene: self.scene,
                moving: &places,
                kernel: self.kernel,
            };
            let margin = CORRECTION_MARGINS[round.min(CORRECTION_MARGINS.len() - 1)];
            let corrected = CORRECTION
                .with_borrow_mut(|memory| corrector.correct(margin, &mut path, memory, |_| false));
            motion = self.time(&path).ok()?;
            if corrected == Correction::Clear
                && let Ok(certified) = self.certified(motion.clone())
            {
                return Some((path, certified));
            }
        }
        None
    }

    /// Where the balls can be when the motion is at each of its waypoints.
    fn places(&self, path: &[Configuration], motion: &Trajectory) -> Vec<Scene> {
        let times = [0.0, motion.duration()];
        // Within the time of a short motion a ball leaves fewer places than it may come back to.
        let is_short = self.moving.is_seen_within(motion.duration());
        let cover = if is_short {
            Cover::SinceSeen
        } else {
            Cover::MovingAlong
        };
        let covering = self.moving.cover(cover, self.padded, USUAL_STOP_S, times);
        let covering = covering.unwrap_or_default();
        let at = |time| covering.iter().map(|ball| ball.at(time)).collect();
        let times = waypoint_times(path, motion).into_iter();
        // Balls so far away that they are none of a scene are not near the robot.
        times
            .map(|time| Scene::new(at(time)).unwrap_or_default())
            .collect()
    }

    /// The motion after the shortest wait at its start for which it is certified.
    fn waiting(&self, motion: &Trajectory) -> Option<Certified> {
        if motion.knots().len() >= self.knots {
            return None;
        }
        let until = motion.duration() + LONGEST_WAIT_S;
        let covers = self.moving.covers(self.padded, USUAL_STOP_S, [0.0, until]);
        let waiting = covers.filter_map(|covering| self.waiting_for(motion, &covering));
        waiting.min_by(|a, b| a.metrics.duration_s.total_cmp(&b.metrics.duration_s))
    }

    /// The same with what covers the balls until after the longest wait.
    fn waiting_for(&self, motion: &Trajectory, covering: &[MovingBall]) -> Option<Certified> {
        let duration = motion.duration();
        let after = |later_s: f64| {
            let later = |ball: &MovingBall| MovingBall {
                ball: ball.at(later_s),
                ..*ball
            };
            covering.iter().map(later).collect::<Vec<_>>()
        };
        let rest = resting(&motion.knots()[0].position, WAIT_STEP_S)?;
        let begun = |wait_s: f64| {
            let is_clear = self.stands_clear(motion, wait_s)
                && certify_moving(self.padded, &after(wait_s), motion, [0.0, duration]).is_free();
            is_clear.then(|| self.certified(begun_after(motion, wait_s)?).ok())?
        };
        for step in 0..WAIT_STEPS {
            let from_s = WAIT_STEP_S * f64::from(step);
            if (self.interrupt)()
                || !certify_moving(self.padded, &after(from_s), &rest, [0.0, WAIT_STEP_S]).is_free()
            {
                return None;
            }
            if let Some(certified) = begun(from_s + WAIT_STEP_S) {
                return Some(self.sooner(from_s, certified, motion, begun));
            }
        }
        None
    }

    /// The motion that begins a step after a time (s) for which none begins, or one that begins sooner.
    fn sooner(
        &self,
        from_s: f64,
        mut latest: Certified,
        motion: &Trajectory,
        begun: impl Fn(f64) -> Option<Certified>,
    ) -> Certified {
        let mut too_soon_s = from_s;
        for _ in 0..WAIT_HALVINGS {
            let wait_s = latest.metrics.duration_s - motion.duration();
            let middle_s = 0.5 * (too_soon_s + wait_s);
            match begun(middle_s) {
                Some(sooner) => latest = sooner,
                None => too_soon_s = middle_s,
            }
        }
        latest
    }

    /// Whether balls no longer come to the end of a motion that begins after a wait.
    fn stands_clear(&self, motion: &Trajectory, wait_s: f64) -> bool {
        let end_s = wait_s + motion.duration();
        self.moving
            .stands_clear(self.padded, &motion.end(), USUAL_STOP_S, end_s)
    }

    /// The fastest of some slower motions along a path that is certified.
    fn slower(&self, path: &[Configuration]) -> Option<Certified> {
        let certified = |share: &f64| {
            let slower = Self {
                limits: TendonLimits::scaled(&self.limits, *share),
                ..*self
            };
            slower.certified(slower.time(path).ok()?).ok()
        };
        let mut tried = SLOWER.iter().take_while(|_| !(self.interrupt)());
        tried.find_map(certified)
    }
}

/// A rest in a configuration, rad.
fn resting(at: &Configuration, duration_s: f64) -> Option<Trajectory> {
    let knots = [0.0, duration_s].map(|time| Knot::resting(time, *at));
    Trajectory::new(knots.to_vec()).ok()
}

/// A motion that begins at rest, after a wait at its start.
fn begun_after(motion: &Trajectory, wait_s: f64) -> Option<Trajectory> {
    let start = Knot::resting(0.0, motion.knots()[0].position);
    let later = motion.knots().iter().map(|knot| Knot {
        time: knot.time + wait_s,
        ..*knot
    });
    Trajectory::new(std::iter::once(start).chain(later).collect()).ok()
}

/// The times at which a motion along a path is at its waypoints, s, by the length of the way to each.
fn waypoint_times(path: &[Configuration], motion: &Trajectory) -> Vec<f64> {
    let samples = motion.sample(SAMPLES);
    let (passed, of_path) = (lengths(&samples), lengths(path));
    let scale = passed[passed.len() - 1] / of_path[of_path.len() - 1].max(f64::MIN_POSITIVE);
    let step_s = motion.duration() / (SAMPLES - 1) as f64;
    let time = |length: &f64| {
        let wanted = length * scale;
        let next = passed.partition_point(|passed| *passed < wanted);
        let next = next.clamp(1, SAMPLES - 1);
        let span = (passed[next] - passed[next - 1]).max(f64::MIN_POSITIVE);
        let part = ((wanted - passed[next - 1]) / span).clamp(0.0, 1.0);
        step_s * ((next - 1) as f64 + part)
    };
    of_path.iter().map(time).collect()
}

/// The length of the way to each of these configurations along all before it, rad.
fn lengths(configurations: &[Configuration]) -> Vec<f64> {
    let steps = configurations
        .windows(2)
        .map(|pair| (pair[1] - pair[0]).norm());
    let sums = steps.scan(0.0, |sum, step| {
        *sum += step;
        Some(*sum)
    });
    std::iter::once(0.0).chain(sums).collect()
}
