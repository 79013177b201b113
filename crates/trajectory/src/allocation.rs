//! From waypoints to a motion: spline, fastest speeds, bounded jerk, knots, exact verification.

use crate::jerk::TimedPath;
use crate::placement::{Placement, Target};
use crate::spline::Spline;
use crate::tendon::{TendonRows, limits_are_valid};
use crate::topp::{EndSpeeds, SpeedProfile};
use crate::width::WidthSearch;
use crate::{Knot, LimitUse, Trajectory};
use pcc_model::{Configuration, TendonLimits, TendonMap};

/// The most knots that a motion may have.
pub const MAX_KNOTS: usize = 256;
/// Duration of a motion that goes nowhere, s.
const REST_DURATION: f64 = 1e-3;
/// Knots whose times must grow by more than this are compared with those of the widest average.
const POOR_FIT: f64 = 1.03;
/// A path shorter than this part of its largest position is within rounding of a straight line.
const ROUNDING: f64 = 1e-11;

/// How finely [`allocate`] works.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AllocationOptions {
    /// The most knots of the result, 4 to [`MAX_KNOTS`]. A quarter of them is laid evenly in time, the others where
    /// limits would be exceeded, so fewer may be used.
    pub knots: usize,
    /// About how many intervals the speed is planned on, at least 1 (more where limits would be exceeded).
    pub grid_intervals: usize,
    /// Polyline chords longer than this are divided, rad: the spline then stays closer to them (about 0.08 × this
    /// × the change of direction, as a vector difference, at a lone corner).
    pub spacing: f64,
}

impl Default for AllocationOptions {
    fn default() -> Self {
        Self {
            knots: 96,
            grid_intervals: 96,
            spacing: 0.1,
        }
    }
}

/// Why waypoints cannot become a motion.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum AllocationError {
    /// No waypoint at all.
    #[error("a motion needs at least one waypoint")]
    NoWaypoints,
    /// A waypoint with NaN or an infinity, or so large that its norm overflows.
    #[error("waypoint {0} is not finite")]
    WaypointNotFinite(usize),
    /// A limit that is zero, negative or not finite.
    #[error("tendon limits must be finite and above zero, got {0:?}")]
    Limits(TendonLimits),
    /// A setting out of range.
    #[error(
        "allocation options out of range (knots 4..={MAX_KNOTS}, grid_intervals ≥ 1, spacing > 0): {0:?}"
    )]
    Options(AllocationOptions),
    /// A velocity or acceleration at an end with NaN or an infinity, or so large that its norm overflows.
    #[error("the velocity or acceleration at the {0} is not finite")]
    EndNotFinite(End),
    /// An end that is faster, or accelerates more, than the limits allow.
    #[error(
        "the {end} uses {use_of_limit} of a tendon's velocity or acceleration limit; 1 is the most"
    )]
    EndExceeds {
        /// Which end.
        end: End,
        /// The larger of both uses.
        use_of_limit: f64,
    },
    /// The path cannot be begun or ended with this velocity: it turns too soon, or is too short to brake.
    #[error(
        "the path cannot be followed at {speed} rad/s at its {end}; {largest} rad/s is the most"
    )]
    NotControllable {
        /// Which end.
        end: End,
        /// The speed asked for, rad/s.
        speed: f64,
        /// The largest speed, rad/s; 0 if no speed is possible.
        largest: f64,
    },
    /// The limits leave no room for the state at an end: with its acceleration it must exceed one within its path.
    #[error("the motion would use {0} of a limit; 1 is the most")]
    NoRoom(f64),
    /// Times or their powers leave the range of f64.
    #[error("the path cannot be timed within f64's range under {0:?}")]
    NotTimeable(TendonLimits),
}

/// An end of a motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// Where it begins.
    Start,
    /// Where it ends.
    Finish,
}

impl std::fmt::Display for End {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str(match self {
            Self::Start => "start",
            Self::Finish => "end",
        })
    }
}

/// The memory of an allocation, kept between calls: after the first ones only the result is allocated.
#[derive(Clone, Debug, Default)]
pub struct Allocator {
    rows: TendonRows,
    spline: Spline,
    profile: SpeedProfile,
    timed: TimedPath,
    search: WidthSearch,
    placement: Placement,
    wider: Placement,
    inner_waypoints: Vec<Configuration>,
}

/// The fastest motion along `waypoints` within the tendons' limits, from rest to rest; see [`Allocator::allocate`].
///
/// # Errors
/// See [`AllocationError`].
pub fn allocate(
    waypoints: &[Configuration],
    tendons: &TendonMap,
    limits: &TendonLimits,
    options: &AllocationOptions,
) -> Result<Trajectory, AllocationError> {
    Allocator::default().allocate(waypoints, tendons, limits, options)
}

impl Allocator {
    /// The fastest motion along `waypoints` (rad) within the tendons' limits, from rest to rest.
    ///
    /// It starts exactly at the first and ends exactly at the last waypoint; every tendon's velocity, acceleration
    /// and jerk keeps its limit × (1 + 1e-9) everywhere, verified by [`crate::limit_use`] on the result. The path is a C2
    /// spline through the waypoints, rounded by the averaging that bounds jerk (see the sources of `spline` and
    /// `jerk`); waypoints that do not move give a resting motion of 1 ms.
    ///
    /// # Errors
    /// See [`AllocationError`].
    pub fn allocate(
        &mut self,
        waypoints: &[Configuration],
        tendons: &TendonMap,
        limits: &TendonLimits,
        options: &AllocationOptions,
    ) -> Result<Trajectory, AllocationError> {
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

    /// Duration of the fastest motion along `waypoints` (rad) from rest to rest if jerk were not bounded, s: TOPP-RA's.
    ///
    /// No motion along this path within the velocity and acceleration limits is faster; 0 if the waypoints do not move.
    ///
    /// # Errors
    /// See [`AllocationError`].
    pub fn fastest_duration(
        &mut self,
        waypoints: &[Configuration],
        tendons: &TendonMap,
        limits: &TendonLimits,
        options: &AllocationOptions,
    ) -> Result<f64, AllocationError> {
        check(waypoints, limits, options)?;
        self.rows.rebuild(tendons);
        if !self.spline.rebuild(waypoints, options.spacing, ROUNDING) {
            return Ok(0.0);
        }
        self.time_spline(limits, options)?;
        Ok(self.timed.duration())
    }

    /// The speeds of the last motion before its jerk was bounded: path parameter s (rad) and ṡ (rad/s) at the points
    /// of TOPP-RA's grid.
    pub fn path_speeds(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        let grid = self.profile.grid().iter();
        let speeds = self.profile.square_speeds().iter();
        grid.zip(speeds)
            .map(|(place, square)| (place.parameter, square.sqrt()))
    }

    fn time_spline(
        &mut self,
        limits: &TendonLimits,
        options: &AllocationOptions,
    ) -> Result<(), AllocationError> {
        let (spline, rows, rest) = (&self.spline, &self.rows, EndSpeeds::default());
        let solved = self
            .profile
            .solve(spline, rows, limits, rest, options.grid_intervals);
        if solved.is_err() || !self.timed.rebuild(spline, &self.profile) {
            return Err(AllocationError::NotTimeable(*limits));
        }
        Ok(())
    }

    fn knots_along_spline(
        &mut self,
        waypoints: &[Configuration],
        limits: &TendonLimits,
        options: &AllocationOptions,
    ) -> Result<(Vec<Knot>, f64), AllocationError> {
        self.time_spline(limits, options)?;
        let duration = self.timed.duration();
        // Narrower than half a segment, knots would not show the average.
        let narrowest = 0.5 * duration / options.knots as f64;
        let widest = (2.0 * limits.acceleration / limits.jerk).clamp(narrowest, 0.5 * duration);
        let width = self
            .search
            .find(&self.profile, &self.timed, limits, [narrowest, widest]);
        let ends =
            [waypoints[0], waypoints[waypoints.len() - 1]].map(|end| Knot::resting(0.0, end));
        let place = |placement: &mut Placement, timed: &mut TimedPath, width| {
            timed.set_average(width);
            let target = Target {
                profile: &self.profile,
                motion: timed,
                rows: &self.rows,
                limits,
                ends,
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

fn check(
    waypoints: &[Configuration],
    limits: &TendonLimits,
    options: &AllocationOptions,
) -> Result<(), AllocationError> {
    if waypoints.is_empty() {
        return Err(AllocationError::NoWaypoints);
    }
    if let Some(index) = waypoints
        .iter()
        .position(|point| !point.norm_squared().is_finite())
    {
        return Err(AllocationError::WaypointNotFinite(index));
    }
    if !limits_are_valid(limits) {
        return Err(AllocationError::Limits(*limits));
    }
    let spacing_is_valid = options.spacing > 0.0;
    if !(4..=MAX_KNOTS).contains(&options.knots) || options.grid_intervals < 1 || !spacing_is_valid
    {
        return Err(AllocationError::Options(*options));
    }
    Ok(())
}

/// Multiplies all times by `scale`, and by what rounding then leaves above the limits.
fn fit_to_limits(
    mut knots: Vec<Knot>,
    mut scale: f64,
    rows: &TendonRows,
    limits: &TendonLimits,
) -> Result<Trajectory, AllocationError> {
    const TOLERANCE: f64 = 5e-10;
    let mut margin = 0.0;
    for _ in 0..8 {
        for knot in &mut knots {
            *knot = slower(knot, scale * (1.0 + margin));
        }
        let motion = Trajectory::new(knots).map_err(|_| AllocationError::NotTimeable(*limits))?;
        let most = LimitUse::at_time_scale(1.0).raised_by_motion(&motion, rows, limits);
        if most.largest() <= 1.0 + TOLERANCE {
            return Ok(motion);
        }
        knots = motion.into_knots();
        scale = most.time_scale();
        // Jerk carries the rounding of positions, which scaling alone does not reduce.
        margin = f64::max(TOLERANCE, 10.0 * margin);
    }
    Err(AllocationError::NotTimeable(*limits))
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

mod moving;

pub use moving::{EndMotion, EndMotions};

#[cfg(test)]
mod tests;
