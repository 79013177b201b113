//! Motions that begin or end moving.
//!
//! The averaged motion begins with velocity v and acceleration a exactly, if what is averaged has constant
//! acceleration a for one width τ before its path begins at p + v τ/2 + a τ²/12 with velocity v + a τ/2; the same
//! backwards at the end. Nothing can be scaled in time then: a margin on the limits takes up what knots add.

use crate::parameterize::end_motion::{EndMotion, EndMotions};
use crate::parameterize::error::{End, ParameterizationError};
use crate::parameterize::options::ParameterizationOptions;
use crate::parameterize::placement::Target;
use crate::parameterize::time_parameterizer::{ROUNDING, TimeParameterizer, check};
use crate::parameterize::topp::{EndSpeeds, Unmet};
use crate::{LimitUse, Trajectory};
use pcc_model::{Configuration, TendonLimits, TendonMap};

/// Parts of the velocity limit that are left unused, tried one after the other; of acceleration twice as much.
const MARGINS: [f64; 3] = [0.01, 0.03, 0.08];
/// Verified limits are kept up to this.
const TOLERANCE: f64 = 1e-9;

/// Where and how fast the path begins so that the average begins as asked for; forwards in time, for either end.
#[derive(Clone, Copy)]
struct Lead {
    point: Configuration,
    velocity: Configuration,
}

impl Lead {
    fn of(position: Configuration, end: &EndMotion, width: f64) -> Self {
        Self {
            point: position
                + end.velocity * (0.5 * width)
                + end.acceleration * (width * width / 12.0),
            velocity: end.velocity + end.acceleration * (0.5 * width),
        }
    }

    fn direction(&self) -> Option<Configuration> {
        self.velocity.try_normalize(0.0)
    }
}

impl TimeParameterizer {
    /// A fast motion along `waypoints` (rad) within the tendons' limits that begins and ends moving.
    ///
    /// It begins and ends with exactly these velocities and accelerations, which need not point along the waypoints:
    /// the path leaves the first point ahead and joins them. All limits × (1 + 1e-9) are kept, verified as in
    /// [`TimeParameterizer::parameterize`], with a margin of 1 % or more between: a motion at rest at both ends is
    /// [`TimeParameterizer::parameterize`]'s.
    ///
    /// # Errors
    /// See [`ParameterizationError`].
    pub fn parameterize_between(
        &mut self,
        waypoints: &[Configuration],
        ends: &EndMotions,
        tendons: &TendonMap,
        limits: &TendonLimits,
        options: &ParameterizationOptions,
    ) -> Result<Trajectory, ParameterizationError> {
        if ends.start.is_resting() && ends.finish.is_resting() {
            return self.parameterize(waypoints, tendons, limits, options);
        }
        check(waypoints, limits, options)?;
        self.rows.rebuild(tendons);
        self.check_end(End::Start, &ends.start, limits)?;
        self.check_end(End::Finish, &ends.finish, limits)?;
        let mut failure = ParameterizationError::NotTimeable(*limits);
        for margin in MARGINS {
            match self.try_between(waypoints, ends, limits, options, margin) {
                Ok(motion) => return Ok(motion),
                // A margin makes an end less controllable: the first reason is the one to tell.
                Err(error) if margin == MARGINS[0] => failure = error,
                Err(_) => {}
            }
        }
        Err(failure)
    }

    fn check_end(
        &self,
        end: End,
        motion: &EndMotion,
        limits: &TendonLimits,
    ) -> Result<(), ParameterizationError> {
        if !motion.is_finite() {
            return Err(ParameterizationError::EndNotFinite(end));
        }
        let velocity = self.rows.largest(&motion.velocity) / limits.velocity;
        let acceleration = self.rows.largest(&motion.acceleration) / limits.acceleration;
        let use_of_limit = velocity.max(acceleration);
        if use_of_limit > 1.0 + TOLERANCE {
            return Err(ParameterizationError::EndExceeds { end, use_of_limit });
        }
        Ok(())
    }

    fn try_between(
        &mut self,
        waypoints: &[Configuration],
        ends: &EndMotions,
        limits: &TendonLimits,
        options: &ParameterizationOptions,
        margin: f64,
    ) -> Result<Trajectory, ParameterizationError> {
        let kept = 1.0 - margin;
        let inner = TendonLimits {
            acceleration: limits.acceleration * kept * kept,
            ..*limits
        };
        let width = 2.0 * limits.acceleration / (limits.jerk * kept * kept * kept);
        let (first, last) = (waypoints[0], waypoints[waypoints.len() - 1]);
        let start = Lead::of(first, &ends.start, width);
        let finish = Lead::of(last, &ends.finish.reversed(), width);
        self.join(waypoints, start.point, finish.point);
        let directions = [
            start.direction(),
            finish.direction().map(|backwards| -backwards),
        ];
        let (points, spacing) = (&self.inner_waypoints, options.spacing);
        let speeds = EndSpeeds {
            start: start.velocity.norm(),
            end: finish.velocity.norm(),
            margin,
        };
        let still = || not_controllable(Unmet::Start(0.0), speeds);
        if !self
            .spline
            .rebuild_between(points, directions, spacing, ROUNDING)
        {
            return Err(still());
        }
        let intervals = options.grid_intervals;
        self.profile
            .solve(&self.spline, &self.rows, &inner, speeds, intervals)
            .map_err(|unmet| not_controllable(unmet, speeds))?;
        if !self.timed.rebuild(&self.spline, &self.profile) {
            return Err(ParameterizationError::NotTimeable(*limits));
        }
        self.timed.set_average_between(
            width,
            [start.velocity, ends.start.acceleration],
            [-finish.velocity, ends.finish.acceleration],
        );
        let target = Target {
            profile: &self.profile,
            motion: &self.timed,
            rows: &self.rows,
            limits,
            ends: [ends.start.knot(first), ends.finish.knot(last)],
            knots: options.knots,
        };
        self.placement.place(&target);
        let motion = Trajectory::new(self.placement.knots())
            .map_err(|_| ParameterizationError::NotTimeable(*limits))?;
        let most = LimitUse::at_time_scale(1.0).raised_by_motion(&motion, &self.rows, limits);
        if most.largest() > 1.0 + TOLERANCE {
            return Err(ParameterizationError::NoRoom(most.largest()));
        }
        Ok(motion)
    }

    /// The waypoints between the points where the path begins and ends, but those that it has just passed there.
    fn join(&mut self, waypoints: &[Configuration], first: Configuration, last: Configuration) {
        let begin = 2.0 * (first - waypoints[0]).norm();
        let end = 2.0 * (last - waypoints[waypoints.len() - 1]).norm();
        let chords = || waypoints.windows(2).map(|pair| (pair[1] - pair[0]).norm());
        let length: f64 = chords().sum();
        self.inner_waypoints.clear();
        self.inner_waypoints.push(first);
        let mut passed = 0.0;
        for (point, chord) in waypoints[1..].iter().zip(chords()) {
            passed += chord;
            if passed > begin && length - passed > end {
                self.inner_waypoints.push(*point);
            }
        }
        self.inner_waypoints.push(last);
    }
}

fn not_controllable(unmet: Unmet, speeds: EndSpeeds) -> ParameterizationError {
    let (end, speed, largest) = match unmet {
        Unmet::Start(largest) => (End::Start, speeds.start, largest),
        Unmet::End(largest) => (End::Finish, speeds.end, largest),
    };
    ParameterizationError::NotControllable {
        end,
        speed,
        largest,
    }
}

#[cfg(test)]
mod tests;
