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
    /// The most knots of the result, 4 to [`MAX_KNOTS`]. Half of them are laid evenly in time, the others where
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
            grid_intervals: 128,
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
    /// Times or their powers leave the range of f64.
    #[error("the path cannot be timed within f64's range under {0:?}")]
    NotTimeable(TendonLimits),
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
    /// and jerk keeps its limit × (1 + 1e-9) everywhere, verified by [`limit_use`] on the result. The path is a C2
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
            self.knots_along_spline(limits, options)?
        } else {
            let last = waypoints[waypoints.len() - 1];
            let end = Knot::resting(REST_DURATION, last);
            (vec![Knot::resting(0.0, waypoints[0]), end], 1.0)
        };
        fit_to_limits(knots, scale, &self.rows, limits)
    }

    /// Duration of the last motion before its jerk was bounded (TOPP-RA's), s; 0 if there was none.
    pub fn unfiltered_duration(&self) -> f64 {
        self.timed.duration()
    }

    fn knots_along_spline(
        &mut self,
        limits: &TendonLimits,
        options: &AllocationOptions,
    ) -> Result<(Vec<Knot>, f64), AllocationError> {
        let Self {
            rows,
            spline,
            profile,
            timed,
            search,
            placement,
            wider,
        } = self;
        let solved = profile.solve(
            spline,
            rows,
            limits,
            EndSpeeds::default(),
            options.grid_intervals,
        );
        if !solved || !timed.rebuild(spline, profile) {
            return Err(AllocationError::NotTimeable(*limits));
        }
        let target = Target {
            profile,
            motion: timed,
            rows,
            limits,
            knots: options.knots,
        };
        // Narrower than half a segment, knots would not show the average.
        let narrowest = 0.5 * timed.duration() / options.knots as f64;
        let widest =
            (2.0 * limits.acceleration / limits.jerk).clamp(narrowest, 0.5 * timed.duration());
        let width = search.find(profile, timed, limits, [narrowest, widest]);
        let scale = placement.place(&target, width);
        if scale > POOR_FIT && width < widest {
            let wider_scale = wider.place(&target, widest);
            if wider_scale * (timed.duration() + widest) < scale * (timed.duration() + width) {
                return Ok((wider.knots(), wider_scale));
            }
        }
        Ok((placement.knots(), scale))
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

#[cfg(test)]
mod tests;
