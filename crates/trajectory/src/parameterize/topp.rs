//! Time-optimal speed along a path: TOPP-RA in tendon space.
//!
//! Source: H. Pham and Q.-C. Pham, "A New Approach to Time-Optimal Path Parameterization Based on Reachability
//! Analysis", IEEE Transactions on Robotics 34(3), 2018. With x = ṡ² and u = s̈ the limits of a tendon of path
//! derivatives l′, l″ are |l′| √x ≤ v and |l′ u + l″ x| ≤ a, and between grid points (u constant) x is linear in s.
//! The backward pass finds the x from which the end can be reached, the forward pass is as fast as they allow.
//! Every acceleration limit is imposed at both ends of each interval (their "first-order interpolation scheme").

use crate::curve::spline::Spline;
use crate::limits::tendon_rows::{
    LANES, TendonRows, combined, lanes, largest_lane, raise_to_magnitude,
};
use crate::parameterize::interval::{FULL_USE, Interval, Polygon, largest_second, use_of};
use crate::parameterize::overlap::{Overlap, Step};
use crate::parameterize::tendon_path::{
    Derivatives, GridPoint, PieceWeights, TendonPath, largest_slope,
};
use pcc_model::TendonLimits;

/// The solver's memory, and after [`SpeedProfile::solve`] its result: x = ṡ² at each grid point.
#[derive(Clone, Debug, Default)]
pub(crate) struct SpeedProfile {
    path: TendonPath,
    grid: Vec<GridPoint>,
    refined: Vec<GridPoint>,
    /// Derivatives of each grid point, block by block.
    derivatives: Vec<Derivatives>,
    /// The largest |l′| ÷ the acceleration limit at each grid point.
    steepness: Vec<f64>,
    /// The largest x within the velocity limit at each grid point.
    speed_cap: Vec<f64>,
    /// The largest x at each grid point from which the end can be reached; the least is 0.
    reachable: Vec<f64>,
    square_speed: Vec<f64>,
    /// When the path begins, s: while a robot brakes that may be later than the braking.
    begin: f64,
    polygon: Polygon,
}

/// Between grid points the sampled limits may be exceeded by this much before an interval is divided.
const EXCESS_TOLERANCE: f64 = 0.02;
/// The value of x at a point where no limit bounds it, since no tendon moves there.
const UNBOUNDED: f64 = 1e100;
/// Into how many parts an interval is divided whose speeds are not optimal.
const PARTS_WHERE_NOT_OPTIMAL: u32 = 4;

/// How finely the speed is planned.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Grid {
    /// About how many intervals there are at first.
    pub(crate) intervals: usize,
    /// The most times that they are divided where that is needed.
    pub(crate) refinements: usize,
}

impl Grid {
    /// So many intervals, refined as often as pays off.
    pub(crate) fn refined(intervals: usize) -> Self {
        Self {
            intervals,
            refinements: 2,
        }
    }

    /// So many intervals, as they are: for durations that need not be exact.
    pub(crate) fn coarse(intervals: usize) -> Self {
        Self {
            intervals,
            refinements: 0,
        }
    }
}

impl SpeedProfile {
    /// Finds the fastest x from rest to rest along `spline` on a grid, beside a braking that uses
    /// the limits too; false where numbers leave f64's range.
    pub(crate) fn solve(
        &mut self,
        spline: &Spline,
        rows: &TendonRows,
        limits: &TendonLimits,
        grid: Grid,
        braking: Option<&Overlap>,
    ) -> bool {
        self.path.rebuild(spline, rows, limits.acceleration);
        let largest_speed = limits.velocity / limits.acceleration;
        self.lay_grid(spline, grid.intervals);
        for round in 0..=grid.refinements {
            self.project(spline, largest_speed);
            if !self.backward() {
                return false;
            }
            match braking {
                None => {
                    self.begin = 0.0;
                    self.forward(0, 0.0);
                }
                Some(braking) => self.forward_beside(braking, largest_speed),
            }
            if round == grid.refinements || !self.refine(largest_speed) {
                break;
            }
        }
        true
    }

    pub(crate) fn grid(&self) -> &[GridPoint] {
        &self.grid
    }

    /// When the path begins, s after the braking does.
    pub(crate) fn begin(&self) -> f64 {
        self.begin
    }

    pub(crate) fn square_speeds(&self) -> &[f64] {
        &self.square_speed
    }

    /// The largest |l′| ÷ the acceleration limit at each grid point.
    pub(crate) fn steepness(&self) -> &[f64] {
        &self.steepness
    }

    /// The derivatives at grid point `i`, block by block.
    pub(crate) fn derivatives(&self, i: usize) -> &[Derivatives] {
        &self.derivatives[i * self.path.blocks..(i + 1) * self.path.blocks]
    }

    /// Lays the grid, about `intervals` intervals long; every node of the spline is a grid point, so l″ is linear within an interval.
    fn lay_grid(&mut self, spline: &Spline, intervals: usize) {
        self.grid.clear();
        let nodes = spline.parameters();
        let wanted = intervals as f64 / spline.length();
        for (piece, pair) in nodes.windows(2).enumerate() {
            let parts = ((pair[1] - pair[0]) * wanted).round().max(1.0);
            for part in 0..parts as usize {
                let parameter = pair[0] + (pair[1] - pair[0]) * (part as f64 / parts);
                self.grid.push(GridPoint { piece, parameter });
            }
        }
        self.grid.push(GridPoint {
            piece: nodes.len() - 2,
            parameter: spline.length(),
        });
    }

    /// Computes derivatives and the largest x within the velocity limit at each grid point.
    fn project(&mut self, spline: &Spline, largest_speed: f64) {
        self.derivatives.clear();
        self.steepness.clear();
        self.speed_cap.clear();
        for place in &self.grid {
            let at = self.derivatives.len();
            let weights = PieceWeights::at(spline, *place);
            for derivatives in self.path.derivatives(&weights) {
                self.derivatives.push(derivatives);
            }
            let steepness = largest_slope(&self.derivatives[at..]);
            self.steepness.push(steepness);
            let speed = largest_speed / steepness;
            self.speed_cap.push((speed * speed).min(UNBOUNDED));
        }
    }

    fn interval(&self, i: usize) -> Interval<'_> {
        Interval {
            from: self.derivatives(i),
            to: self.derivatives(i + 1),
            half: 0.5 / (self.grid[i + 1].parameter - self.grid[i].parameter),
        }
    }

    /// Finds the largest x from which rest at the end can be reached (the "controllable sets"); false where there is none.
    fn backward(&mut self) -> bool {
        let count = self.grid.len();
        self.reachable.clear();
        self.reachable.resize(count, 0.0);
        let mut polygon = std::mem::take(&mut self.polygon);
        for i in (0..count - 1).rev() {
            let interval = self.interval(i);
            let next = self.reachable[i + 1];
            let Some(reachable) = polygon.largest_first(self.speed_cap[i], next, &interval) else {
                return false;
            };
            self.reachable[i] = reachable;
        }
        self.polygon = polygon;
        true
    }

    /// From x at the grid point `first`, the largest x at each next point.
    fn forward(&mut self, first: usize, mut x: f64) {
        self.square_speed.truncate(first);
        self.square_speed.push(x);
        for i in first..self.grid.len() - 1 {
            let most = self.reachable[i + 1];
            let interval = self.interval(i);
            // Rounding may bring it below 0, which is reachable from every x of the controllable set.
            x = if interval.allows([x, most]) {
                most
            } else {
                largest_second(&interval, x).min(most).max(0.0)
            };
            self.square_speed.push(x);
        }
    }

    /// From rest at the start, the largest x at each next point that leave the braking what it uses of the limits; where it leaves
    /// too little, the path begins after it.
    fn forward_beside(&mut self, braking: &Overlap, largest_speed: f64) {
        (self.begin, self.square_speed) = (0.0, vec![0.0]);
        let (mut time, mut x) = (0.0, 0.0);
        for i in 0..self.grid.len() - 1 {
            if time >= braking.duration() {
                self.forward(i, x);
                return;
            }
            let interval = self.interval(i);
            let step = Step {
                interval,
                time,
                length: self.grid[i + 1].parameter - self.grid[i].parameter,
                x,
                largest_speed,
            };
            let most = self.reachable[i + 1];
            let next = braking.largest_second(&step, most);
            let Some(next) = next.filter(|next| *next > 0.0) else {
                self.begin = braking.duration();
                self.forward(0, 0.0);
                return;
            };
            time += step.duration(next);
            x = next;
            self.square_speed.push(x);
        }
    }

    /// Divides intervals; false if all are fine enough, or as fine as numbers allow.
    fn refine(&mut self, largest_speed: f64) -> bool {
        self.refined.clear();
        let mut divided = false;
        for i in 0..self.grid.len() - 1 {
            let (from, to) = (self.grid[i], self.grid[i + 1]);
            self.refined.push(from);
            let length = to.parameter - from.parameter;
            let middle = 0.5 * (from.parameter + to.parameter);
            let quarter = 0.25 * length;
            let is_inside = middle - quarter > from.parameter && middle + quarter < to.parameter;
            if is_inside {
                let parts = self.wanted_parts(i, largest_speed);
                divided |= parts > 1;
                self.refined.extend((1..parts).map(|part| GridPoint {
                    piece: from.piece,
                    parameter: from.parameter + length * (f64::from(part) / f64::from(parts)),
                }));
            }
        }
        self.refined.push(self.grid[self.grid.len() - 1]);
        std::mem::swap(&mut self.grid, &mut self.refined);
        divided
    }

    /// Into how many parts an interval is to be divided: several where its speeds are not optimal, since speed at the start costs
    /// speed at the end or no limit is fully used (neither happens on a fine grid), two where a limit is exceeded in its middle.
    fn wanted_parts(&self, i: usize, largest_speed: f64) -> u32 {
        let squares = [self.square_speed[i], self.square_speed[i + 1]];
        let interval = self.interval(i);
        let acceleration = use_of(&interval, squares);
        let is_fastest = |j: usize| self.square_speed[j] > FULL_USE * FULL_USE * self.speed_cap[j];
        let is_idle = !acceleration.is_full && !is_fastest(i) && !is_fastest(i + 1);
        if acceleration.trades || is_idle {
            PARTS_WHERE_NOT_OPTIMAL
        } else if use_in_the_middle(&interval, squares, largest_speed) > 1.0 + EXCESS_TOLERANCE {
            2
        } else {
            1
        }
    }
}

/// The largest part of a limit (1: all of it) that a pair uses in the middle of its interval, in which l″ is linear;
/// `largest_speed` is the limit of velocity ÷ that of acceleration.
#[inline(always)]
fn use_in_the_middle(interval: &Interval<'_>, squares: [f64; 2], largest_speed: f64) -> f64 {
    let x = 0.5 * (squares[0] + squares[1]);
    let u = (squares[1] - squares[0]) * interval.half;
    let half_length = 0.25 / interval.half;
    let (mut force, mut slope) = ([0.0; LANES], [0.0; LANES]);
    for (from, to) in interval.from.iter().zip(interval.to) {
        let turn = combined(&from.bend, 0.75 * half_length, &to.bend, 0.25 * half_length);
        let middle = lanes(|i| from.slope[i] + turn[i]);
        let bend = combined(&from.bend, 0.5, &to.bend, 0.5);
        raise_to_magnitude(&mut slope, &middle);
        raise_to_magnitude(&mut force, &combined(&middle, u, &bend, x));
    }
    largest_lane(&force).max(largest_lane(&slope) * x.sqrt() / largest_speed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_paths::{smooth_path, unit_limits, unit_tendons};
    use pcc_model::Configuration;
    use rand::SeedableRng;

    fn solved(path: &[Configuration], intervals: usize) -> (Spline, SpeedProfile, bool) {
        let (mut spline, mut profile) = (Spline::default(), SpeedProfile::default());
        assert!(spline.rebuild(path, 0.1, 0.0));
        let rows = TendonRows::of(&unit_tendons());
        let is_solved = profile.solve(
            &spline,
            &rows,
            &unit_limits(),
            Grid::refined(intervals),
            None,
        );
        (spline, profile, is_solved)
    }

    fn line() -> [Configuration; 2] {
        [
            Configuration::zeros(),
            Configuration::from_row_slice(&[1.0, 0.5, -0.4, 0.2, 0.7, 0.1]),
        ]
    }

    /// Largest |l′| on the line: tendon length per unit of s.
    fn line_gain() -> f64 {
        let mut lengths = [0.0; 9];
        let chord = line()[1] - line()[0];
        unit_tendons().lengths(&chord, &mut lengths);
        lengths
            .iter()
            .fold(0.0, |most: f64, length| most.max(length.abs()))
            / chord.norm()
    }

    #[test]
    fn a_line_from_rest_to_rest_is_a_trapezoid() {
        let (spline, profile, is_solved) = solved(&line(), 200);
        assert!(is_solved);
        let (limits, gain) = (unit_limits(), line_gain());
        let (speed, slope) = (limits.velocity / gain, limits.acceleration / gain);
        for (place, x) in profile.grid().iter().zip(profile.square_speeds()) {
            let from_end = place.parameter.min(spline.length() - place.parameter);
            let expected = (2.0 * slope * from_end).min(speed * speed);
            assert!(
                (x - expected).abs() < 1e-9 * speed * speed,
                "{x} against {expected}"
            );
        }
    }

    #[test]
    fn the_use_in_the_middle_is_that_of_the_spline_there() {
        let mut random = rand_pcg::Pcg64::seed_from_u64(7);
        let path = smooth_path(&mut random, 32);
        let (spline, profile, _) = solved(&path, 60);
        let largest_speed = unit_limits().velocity / unit_limits().acceleration;
        for (i, (grid, x)) in profile
            .grid()
            .windows(2)
            .zip(profile.square_speeds().windows(2))
            .enumerate()
        {
            let middle = GridPoint {
                piece: grid[0].piece,
                parameter: 0.5 * (grid[0].parameter + grid[1].parameter),
            };
            let weights = PieceWeights::at(&spline, middle);
            let (mean, path_acceleration) = (
                0.5 * (x[0] + x[1]),
                (x[1] - x[0]) * profile.interval(i).half,
            );
            let uses = profile.path.derivatives(&weights).flat_map(|here| {
                let force = combined(&here.slope, path_acceleration, &here.bend, mean);
                let speed = here.slope.map(|slope| slope * mean.sqrt() / largest_speed);
                force.into_iter().chain(speed)
            });
            let expected = uses.fold(0.0, |most: f64, part| most.max(part.abs()));
            let found = use_in_the_middle(&profile.interval(i), [x[0], x[1]], largest_speed);
            assert!(
                (found - expected).abs() < 1e-9,
                "{found} against {expected}"
            );
        }
    }

    #[test]
    fn some_limit_is_active_nearly_everywhere() {
        let mut random = rand_pcg::Pcg64::seed_from_u64(7);
        let (rows, limits) = (TendonRows::of(&unit_tendons()), unit_limits());
        for i in 0..400 {
            let intervals = [128, 250][i % 2];
            let (spline, profile, is_solved) = solved(&smooth_path(&mut random, 64), intervals);
            assert!(is_solved);
            let (grid, squares) = (profile.grid(), profile.square_speeds());
            let (mut active, mut total) = (0.0, 0.0);
            for i in 0..grid.len() - 1 {
                let step = grid[i + 1].parameter - grid[i].parameter;
                let duration = 2.0 * step / (squares[i].sqrt() + squares[i + 1].sqrt());
                let slope = 0.5 * (squares[i + 1] - squares[i]) / step;
                let usage = [i, i + 1].map(|k| {
                    let path = spline.at(grid[i].piece, grid[k].parameter);
                    let speed = rows.largest(&path.slope) * squares[k].sqrt() / limits.velocity;
                    let force = rows.largest(&(path.slope * slope + path.bend * squares[k]));
                    speed.max(force / limits.acceleration)
                });
                let most = usage[0].max(usage[1]);
                assert!(most <= 1.0 + 1e-9, "{most}");
                total += duration;
                active += if most > 1.0 - 1e-6 { duration } else { 0.0 };
            }
            assert!(
                active > 0.97 * total,
                "a limit is active {active} of {total} s"
            );
        }
    }

    /// Durations by the Python package toppra 0.6.10: natural `SplineInterpolator` through the tendon lengths by
    /// chord length, 16 equal intervals a chord, interpolation scheme, Seidel's solver. The first number of each
    /// path tells that it is the same path.
    #[test]
    fn durations_agree_with_toppra() {
        const REFERENCE: [(f64, f64); 5] = [
            (-0.239_494_937_726_706_16, 4.139_076_314_457_316),
            (-0.473_079_846_517_712_2, 6.277_933_479_749_062),
            (0.283_009_149_982_413_44, 9.574_421_695_177_685),
            (0.352_214_290_183_955_56, 3.571_345_851_245_15),
            (-0.297_598_640_547_16, 5.680_970_084_159_871),
        ];
        let mut random = rand_pcg::Pcg64::seed_from_u64(5);
        for (first, reference) in REFERENCE {
            let path = smooth_path(&mut random, 64);
            assert_eq!(path[0][0], first);
            for (intervals, tolerance) in [(252, 1e-3), (1008, 1e-4)] {
                let (spline, profile, is_solved) = solved(&path, intervals);
                let mut timed = crate::parameterize::jerk::TimedPath::default();
                assert!(is_solved && timed.rebuild(&spline, &profile));
                let error = timed.duration() / reference - 1.0;
                assert!(
                    error.abs() < tolerance,
                    "{error} with {intervals} intervals"
                );
            }
        }
    }
}
