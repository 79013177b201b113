//! The fastest motion to rest that begins in a moving state: the path begins while the robot still brakes.
//!
//! The sum ζ(t) = b(t) + n(t) − ζ_b of a braking b straight ahead, which comes to rest in ζ_b, and of a motion n along a path from ζ_b
//! keeps every limit that the time parameterization of n leaves to b. Both are averaged over the same width, so the sum
//! begins with exactly the state that b begins with.

use crate::limits::tendon_rows::TendonRows;
use crate::parameterize::options::{ParameterizationError, ParameterizationOptions};
use crate::parameterize::overlap::Overlap;
use crate::parameterize::placement::Target;
use crate::parameterize::time_parameterizer::{ROUNDING, TimeParameterizer, check};
use crate::parameterize::topp::Grid;
use crate::scaling::stopping::Braking;
use crate::{Knot, LimitUse, Trajectory};
use pcc_model::{Configuration, TendonLimits, TendonMap};

/// Rounds in which the motion is made slower by what its knots exceed of the limits.
const ROUNDS: usize = 4;
/// Intervals of the grid on which leads are compared.
const COARSE_INTERVALS: usize = 64;
/// Rounds in which the width of the average is fitted.
const WIDTHS: usize = 2;
/// An average may be narrower than the jerk needs by this part of itself.
const WIDTH_TOLERANCE: f64 = 1e-3;
/// A limit may be exceeded by this part of itself, which is rounding.
const TOLERANCE: f64 = 5e-10;
/// Width of the average that is tried first, ÷ (acceleration limit ÷ jerk limit).
const USUAL_WIDTH: f64 = 1.4;
/// The path is timed for limits under which motions take so many times as long: as much as knots usually exceed them, in 6 of 7 motions.
const TIGHTENED: f64 = 1.0022;
/// What a limit is tightened by beyond what knots exceed of it, ÷ that limit.
const MARGIN: f64 = 2e-4;

/// A motion that is to begin in a state and to end with a path.
#[derive(Clone, Copy, Debug)]
pub struct MovingStart<'a> {
    /// The state; its time is not read.
    pub state: Knot,
    /// Where the robot would rest about soonest, and the path from there on, rad.
    pub path: &'a [Configuration],
    /// Shares of the acceleration limit that the braking may use, each above 0 to 1: the path gets the rest. The share with the
    /// shortest motion is taken that keeps the limits; where none does, or there is none, the whole limit, as for a stop.
    pub braking_shares: &'a [f64],
}

/// How the robot brakes.
#[derive(Clone, Copy)]
struct Lead {
    /// Share of the acceleration limit that the braking uses.
    share: f64,
    /// Width of the average, s.
    width: f64,
}

/// A lead, and what a motion with it needs.
struct Estimate {
    lead: Lead,
    /// Width of the average that the jerk limit needs, s.
    needed: f64,
    /// Duration of the motion with that width, s.
    duration: f64,
}

/// What a motion from a moving state is asked for.
struct Problem<'a> {
    start: &'a MovingStart<'a>,
    limits: &'a TendonLimits,
    options: &'a ParameterizationOptions,
}

impl TimeParameterizer {
    /// A fast motion from a moving state to rest at a path's end, beside the path at its begin.
    ///
    /// It begins with exactly the state's position, velocity and acceleration; every tendon keeps its limits × (1 + 5e-10).
    ///
    /// # Errors
    /// See [`ParameterizationError`]; [`ParameterizationError::NotTimeable`] also where the path leaves the braking no room.
    pub fn parameterize_from(
        &mut self,
        start: &MovingStart<'_>,
        tendons: &TendonMap,
        limits: &TendonLimits,
        options: &ParameterizationOptions,
    ) -> Result<Trajectory, ParameterizationError> {
        check(start.path, limits, options)?;
        self.rows.rebuild(tendons);
        let problem = Problem {
            start,
            limits,
            options,
        };
        let mut leads = self.leads(&problem);
        leads.sort_by(|a, b| a.duration.total_cmp(&b.duration));
        let shared = leads
            .iter()
            .find_map(|estimate| self.motion_with(&problem, estimate));
        shared
            .or_else(|| self.motion_after_stop(&problem))
            .ok_or(ParameterizationError::NotTimeable(*limits))
    }

    /// A lead for each share of braking.
    fn leads(&mut self, problem: &Problem<'_>) -> Vec<Estimate> {
        let limits = problem.limits;
        let width = USUAL_WIDTH * limits.acceleration / limits.jerk;
        let shares = problem.start.braking_shares.iter();
        shares
            .filter_map(|&share| self.estimate(problem, Lead { share, width }))
            .collect()
    }

    /// The motion that begins with the stop straight ahead.
    fn motion_after_stop(&mut self, problem: &Problem<'_>) -> Option<Trajectory> {
        let stop = Braking::from(&problem.start.state, &self.rows, problem.limits);
        let lead = Lead {
            share: 1.0,
            width: stop.width(),
        };
        let estimate = self.estimate(problem, lead)?;
        self.motion_with(problem, &estimate)
    }

    /// What a motion with this lead needs, on a coarse grid.
    fn estimate(&mut self, problem: &Problem<'_>, lead: Lead) -> Option<Estimate> {
        let grid = Grid::coarse(COARSE_INTERVALS);
        let needed = self.needed_width(problem, &lead, problem.limits, grid)?;
        Some(Estimate {
            lead,
            needed,
            duration: self.timed.duration() + needed,
        })
    }

    /// The motion that begins with a lead; none where it does not keep the limits.
    fn motion_with(&mut self, problem: &Problem<'_>, estimate: &Estimate) -> Option<Trajectory> {
        let mut lead = self.fit_width(problem, estimate)?;
        let limits = problem.limits;
        if !lead.keeps_velocity(problem, &self.rows) {
            return None;
        }
        let mut slower = slowed(limits, TIGHTENED);
        for _ in 0..ROUNDS {
            let motion = self.motion_in_knots(problem, &lead, &slower)?;
            let most = LimitUse::default().raised_by_motion(&motion, &self.rows, limits);
            if most.largest() <= 1.0 + TOLERANCE {
                return Some(motion);
            }
            lead.width *= tighten(&mut slower, &most);
        }
        None
    }

    fn motion_in_knots(
        &mut self,
        problem: &Problem<'_>,
        lead: &Lead,
        limits: &TendonLimits,
    ) -> Option<Trajectory> {
        let Problem { start, options, .. } = problem;
        let grid = Grid::refined(options.grid_intervals);
        self.needed_width(problem, lead, limits, grid)?;
        let width = lead.width;
        self.timed.set_average(width);
        let total = self.timed.duration() + width;
        let state = Knot {
            time: 0.0,
            ..start.state
        };
        let end = start.path[start.path.len() - 1];
        self.placement.place(&Target {
            profile: &self.profile,
            motion: &self.timed,
            rows: &self.rows,
            limits,
            ends: [state, Knot::resting(total, end)],
            knots: options.knots,
        });
        Trajectory::new(self.placement.knots()).ok()
    }

    /// The lead with an average as narrow as the jerk limit allows, on a coarse grid.
    fn fit_width(&mut self, problem: &Problem<'_>, estimate: &Estimate) -> Option<Lead> {
        let widest = 2.0 * problem.limits.acceleration / problem.limits.jerk;
        let (mut lead, mut needed) = (estimate.lead, estimate.needed);
        for _ in 0..WIDTHS {
            let is_wide_enough = needed <= lead.width * (1.0 + WIDTH_TOLERANCE);
            if is_wide_enough && needed >= lead.width * (1.0 - WIDTH_TOLERANCE) {
                return Some(lead);
            }
            lead.width = needed.min(widest);
            needed = self.estimate(problem, lead)?.needed;
        }
        if needed > lead.width * (1.0 + WIDTH_TOLERANCE) {
            lead.width = widest;
        }
        Some(lead)
    }

    /// Times the path for these limits; the width of the average that the jerk limit needs, s.
    fn needed_width(
        &mut self,
        problem: &Problem<'_>,
        lead: &Lead,
        limits: &TendonLimits,
        grid: Grid,
    ) -> Option<f64> {
        let start = problem.start;
        let braking = lead.braking(problem, &self.rows);
        let path = moved(start.path, &braking.rest_of(&start.state.position));
        if !self
            .spline
            .rebuild(&path, problem.options.spacing, ROUNDING)
        {
            return None;
        }
        let overlap = Overlap::of(braking, &self.rows, limits.acceleration);
        let (spline, rows) = (&self.spline, &self.rows);
        let is_solved = self
            .profile
            .solve(spline, rows, limits, grid, Some(&overlap));
        if !is_solved || !self.timed.rebuild(&self.spline, &self.profile) {
            return None;
        }
        self.timed.add_braking(&braking);
        let (profile, timed) = (&self.profile, &self.timed);
        let search = &mut self.search;
        Some(search.needed_beside(profile, timed, &overlap, limits, lead.width))
    }
}

impl Lead {
    fn braking(&self, problem: &Problem<'_>, rows: &TendonRows) -> Braking {
        let limits = problem.limits;
        let gentler = TendonLimits {
            acceleration: limits.acceleration * self.share,
            ..*limits
        };
        Braking::with_width(self.width, &problem.start.state, rows, &gentler)
    }

    /// Whether the braking alone keeps the velocity limit: a state that still accelerates becomes faster first, the more the gentler it
    /// brakes.
    fn keeps_velocity(&self, problem: &Problem<'_>, rows: &TendonRows) -> bool {
        let state = Knot {
            time: 0.0,
            ..problem.start.state
        };
        let knots = self.braking(problem, rows).knots(state);
        let Ok(motion) = Trajectory::new(knots) else {
            return false;
        };
        let used = LimitUse::default().raised_by_motion(&motion, rows, problem.limits);
        used.velocity <= 1.0 + TOLERANCE
    }
}

/// The path moved to another start, its end where it was.
fn moved(path: &[Configuration], start: &Configuration) -> Vec<Configuration> {
    let off = start - path[0];
    let last = (path.len() - 1).max(1) as f64;
    let point = |(i, point): (usize, &Configuration)| point + off * (1.0 - i as f64 / last);
    path.iter().enumerate().map(point).collect()
}

/// Tightens limits by what knots exceed of them; the factor by which the average is to be wider. Jerk is kept by both, since a wider
/// average alone sees other steps of acceleration.
fn tighten(limits: &mut TendonLimits, used: &LimitUse) -> f64 {
    let excess = |used: f64| {
        if used > 1.0 {
            used * (1.0 + MARGIN)
        } else {
            1.0
        }
    };
    let jerk = excess(used.jerk);
    limits.velocity /= excess(used.velocity);
    limits.acceleration /= excess(used.acceleration).max(jerk.cbrt() * jerk.cbrt());
    jerk
}

/// Limits under which a motion takes `scale` times as long.
fn slowed(limits: &TendonLimits, scale: f64) -> TendonLimits {
    TendonLimits {
        velocity: limits.velocity / scale,
        acceleration: limits.acceleration / (scale * scale),
        jerk: limits.jerk / (scale * scale * scale),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_paths::{smooth_path, unit_limits, unit_tendons};
    use crate::{limit_use, stopping_motion};
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    /// A random instant of a random motion.
    fn moving_state(random: &mut Pcg64) -> Knot {
        let options = ParameterizationOptions::default();
        let motion = TimeParameterizer::default()
            .parameterize(
                &smooth_path(random, 64),
                &unit_tendons(),
                &unit_limits(),
                &options,
            )
            .unwrap();
        let at = motion.at(motion.duration() * random.random_range(0.0..1.0));
        Knot::of(7.0, &at)
    }

    /// A path from `start` to a random configuration.
    fn path_from(start: &Configuration, random: &mut Pcg64) -> Vec<Configuration> {
        moved(&smooth_path(random, 64), start)
    }

    #[test]
    fn motions_begin_in_any_state_within_limits_and_arrive_sooner_than_after_a_stop() {
        let mut random = Pcg64::seed_from_u64(71);
        let (tendons, limits) = (unit_tendons(), unit_limits());
        let options = ParameterizationOptions::default();
        let mut parameterizer = TimeParameterizer::default();
        let mut won = Vec::new();
        for _ in 0..300 {
            let state = moving_state(&mut random);
            let stop = stopping_motion(&state, &tendons, &limits).unwrap();
            let path = path_from(&stop.end(), &mut random);
            let start = MovingStart {
                state,
                path: &path,
                braking_shares: &[0.9, 0.5],
            };
            let joined = parameterizer.parameterize_from(&start, &tendons, &limits, &options);
            let Ok(joined) = joined else {
                won.push(0.0);
                continue;
            };
            assert_eq!(joined.knots()[0], Knot { time: 0.0, ..state });
            let last = joined.knots()[joined.knots().len() - 1];
            assert_eq!(last, Knot::resting(last.time, path[63]));
            let most = limit_use(&joined, &tendons, &limits).largest();
            assert!(most <= 1.0 + 1e-9, "{most}");
            let after = parameterizer.parameterize(&path, &tendons, &limits, &options);
            let stop_then_go = stop.duration() + after.unwrap().duration();
            won.push((stop_then_go - joined.duration()) / stop.duration());
        }
        won.sort_by(f64::total_cmp);
        let none = won.iter().filter(|won| **won <= 0.0).count();
        assert!(none < 5, "{none} of 300 win nothing");
        assert!(won[150] > 0.75, "in the median {} of a stop", won[150]);
    }

    #[test]
    fn a_state_beyond_the_limits_and_a_path_that_goes_nowhere_are_errors() {
        let (tendons, limits) = (unit_tendons(), unit_limits());
        let options = ParameterizationOptions::default();
        let try_from = |state: Knot, path: &[Configuration]| {
            let start = MovingStart {
                state,
                path,
                braking_shares: &[0.9, 0.5],
            };
            TimeParameterizer::default().parameterize_from(&start, &tendons, &limits, &options)
        };
        let rest = Knot::resting(0.0, Configuration::zeros());
        let fast = Knot {
            velocity: Configuration::repeat(9.0),
            ..rest
        };
        let line = [Configuration::zeros(), Configuration::repeat(0.4)];
        assert!(try_from(fast, &line).is_err());
        let unsteady = Knot {
            acceleration: Configuration::repeat(f64::NAN),
            ..rest
        };
        assert!(try_from(unsteady, &line).is_err());
        assert!(try_from(rest, &[]).is_err());
        let still = try_from(rest, &line[..1]);
        assert!(still.is_err(), "{still:?}");
    }
}
