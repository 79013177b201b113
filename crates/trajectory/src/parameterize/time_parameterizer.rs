//! From waypoints to a motion: spline, fastest speeds, bounded jerk, knots, exact verification.

use crate::curve::spline::Spline;
use crate::limits::tendon_rows::{TendonRows, limits_are_valid};
use crate::parameterize::jerk::TimedPath;
use crate::parameterize::options::{MAX_KNOTS, ParameterizationError, ParameterizationOptions};
use crate::parameterize::placement::{Placement, Target};
use crate::parameterize::topp::{Grid, SpeedProfile};
use crate::parameterize::width::WidthSearch;
use crate::{Knot, LimitUse, Trajectory};
use pcc_model::{Configuration, TendonLimits, TendonMap};

/// Duration of a motion that goes nowhere, s.
const REST_DURATION: f64 = 1e-3;
/// Knots whose times must grow by more than this are compared with those of the widest average.
const POOR_FIT: f64 = 1.03;
/// A path shorter than this part of its largest position is within rounding of a straight line.
pub(super) const ROUNDING: f64 = 1e-11;

/// The memory of a time parameterization, kept between calls: after the first ones only the result is allocated.
#[derive(Clone, Debug, Default)]
pub struct TimeParameterizer {
    pub(super) rows: TendonRows,
    pub(super) spline: Spline,
    pub(super) profile: SpeedProfile,
    pub(super) timed: TimedPath,
    pub(super) search: WidthSearch,
    pub(super) placement: Placement,
    wider: Placement,
}

impl TimeParameterizer {
    /// The fastest motion along `waypoints` (rad) within the tendons' limits, from rest to rest.
    ///
    /// It starts exactly at the first and ends exactly at the last waypoint; every tendon's velocity, acceleration
    /// and jerk keeps its limit × (1 + 1e-9) everywhere, verified by [`crate::limit_use`] on the result. The path is a C2
    /// spline through the waypoints, rounded by the average in time that bounds jerk; waypoints that do not move give a resting motion of 1 ms.
    ///
    /// # Errors
    /// See [`ParameterizationError`].
    pub fn parameterize(
        &mut self,
        waypoints: &[Configuration],
        tendons: &TendonMap,
        limits: &TendonLimits,
        options: &ParameterizationOptions,
    ) -> Result<Trajectory, ParameterizationError> {
        check(waypoints, limits, options)?;
        self.rows.rebuild(tendons);
        let (knots, scale) = if self.spline.rebuild(waypoints, options.spacing, ROUNDING) {
            self.knots_along_spline(waypoints, limits, options)?
        } else {
            let last = waypoints[waypoints.len() - 1];
            let end = Knot::resting(REST_DURATION, last);
            (vec![Knot::resting(0.0, waypoints[0]), end], 1.0)
        };
        fit_to_limits(knots, scale, &self.rows, limits)
    }

    /// Duration, s, of TOPP-RA's motion: the fastest along `waypoints` (rad) from rest to rest without a jerk limit.
    ///
    /// No motion along this path within the velocity and acceleration limits is faster; 0 if the waypoints do not move.
    ///
    /// # Errors
    /// See [`ParameterizationError`].
    pub fn fastest_duration(
        &mut self,
        waypoints: &[Configuration],
        tendons: &TendonMap,
        limits: &TendonLimits,
        options: &ParameterizationOptions,
    ) -> Result<f64, ParameterizationError> {
        check(waypoints, limits, options)?;
        self.rows.rebuild(tendons);
        if !self.spline.rebuild(waypoints, options.spacing, ROUNDING) {
            return Ok(0.0);
        }
        self.time_spline(limits, options)?;
        Ok(self.timed.duration())
    }

    /// Path parameter s (rad) and speed ṡ (rad/s) at the points of TOPP-RA's grid, of the last motion before its jerk was
    /// bounded.
    pub fn path_speeds(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        let grid = self.profile.grid().iter();
        let speeds = self.profile.square_speeds().iter();
        grid.zip(speeds)
            .map(|(place, square)| (place.parameter, square.sqrt()))
    }

    fn time_spline(
        &mut self,
        limits: &TendonLimits,
        options: &ParameterizationOptions,
    ) -> Result<(), ParameterizationError> {
        let (spline, grid) = (&self.spline, Grid::refined(options.grid_intervals));
        let is_solved = self.profile.solve(spline, &self.rows, limits, grid, None);
        if !is_solved || !self.timed.rebuild(spline, &self.profile) {
            return Err(ParameterizationError::NotTimeable(*limits));
        }
        Ok(())
    }

    fn knots_along_spline(
        &mut self,
        waypoints: &[Configuration],
        limits: &TendonLimits,
        options: &ParameterizationOptions,
    ) -> Result<(Vec<Knot>, f64), ParameterizationError> {
        self.time_spline(limits, options)?;
        let duration = self.timed.duration();
        // Narrower than half a segment, knots would not show the average.
        let narrowest = 0.5 * duration / options.knots as f64;
        let widest = (2.0 * limits.acceleration / limits.jerk).clamp(narrowest, 0.5 * duration);
        let width = self
            .search
            .find(&self.profile, &self.timed, limits, [narrowest, widest]);
        let place = |placement: &mut Placement, timed: &mut TimedPath, width| {
            timed.set_average(width);
            let target = Target {
                profile: &self.profile,
                motion: timed,
                rows: &self.rows,
                limits,
                ends: [
                    Knot::resting(0.0, waypoints[0]),
                    Knot::resting(duration + width, waypoints[waypoints.len() - 1]),
                ],
                knots: options.knots,
            };
            placement.place(&target)
        };
        let scale = place(&mut self.placement, &mut self.timed, width);
        if scale > POOR_FIT && width < widest {
            let wider_scale = place(&mut self.wider, &mut self.timed, widest);
            if wider_scale * (duration + widest) < scale * (duration + width) {
                return Ok((self.wider.knots(), wider_scale));
            }
        }
        Ok((self.placement.knots(), scale))
    }
}

pub(super) fn check(
    waypoints: &[Configuration],
    limits: &TendonLimits,
    options: &ParameterizationOptions,
) -> Result<(), ParameterizationError> {
    if waypoints.is_empty() {
        return Err(ParameterizationError::NoWaypoints);
    }
    if let Some(index) = waypoints
        .iter()
        .position(|point| !point.norm_squared().is_finite())
    {
        return Err(ParameterizationError::WaypointNotFinite(index));
    }
    if !limits_are_valid(limits) {
        return Err(ParameterizationError::Limits(*limits));
    }
    let spacing_is_valid = options.spacing > 0.0;
    if !(4..=MAX_KNOTS).contains(&options.knots) || options.grid_intervals < 1 || !spacing_is_valid
    {
        return Err(ParameterizationError::Options(*options));
    }
    Ok(())
}

/// A motion through `knots` with all times multiplied by `scale`, and by what rounding then requires to keep the limits.
fn fit_to_limits(
    mut knots: Vec<Knot>,
    mut scale: f64,
    rows: &TendonRows,
    limits: &TendonLimits,
) -> Result<Trajectory, ParameterizationError> {
    const TOLERANCE: f64 = 5e-10;
    let mut margin = 0.0;
    for _ in 0..8 {
        for knot in &mut knots {
            *knot = slower(knot, scale * (1.0 + margin));
        }
        let motion =
            Trajectory::new(knots).map_err(|_| ParameterizationError::NotTimeable(*limits))?;
        let most = LimitUse::at_time_scale(1.0).raised_by_motion(&motion, rows, limits);
        if most.largest() <= 1.0 + TOLERANCE {
            return Ok(motion);
        }
        knots = motion.into_knots();
        scale = most.time_scale();
        // Jerk carries the rounding of positions, which scaling alone does not reduce.
        margin = f64::max(TOLERANCE, 10.0 * margin);
    }
    Err(ParameterizationError::NotTimeable(*limits))
}

/// The knot when all times are multiplied by `scale`.
fn slower(knot: &Knot, scale: f64) -> Knot {
    Knot {
        time: knot.time * scale,
        position: knot.position,
        velocity: knot.velocity / scale,
        acceleration: knot.acceleration / (scale * scale),
    }
}

#[cfg(test)]
mod tests;
