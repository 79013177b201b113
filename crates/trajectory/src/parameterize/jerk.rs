//! A bound on jerk: a moving average in time over the fastest motion.
//!
//! The motion q(t) of TOPP-RA has steps of acceleration. Its average over the last τ seconds,
//! `(1/τ) ∫ q(t − r) dr, r in 0..τ`, with q at rest before its start and after its end, starts and ends at rest
//! at the same points, keeps every bound on tendon velocity v and acceleration a (it averages them too), bounds
//! the jerk by 2a/τ, takes τ longer, and leaves the path by about q̈ τ²/24.

use crate::Knot;
use crate::curve::spline::{PathPoint, Spline};
use crate::parameterize::topp::SpeedProfile;
use crate::scaling::stopping::Braking;
use pcc_model::Configuration;

/// TOPP-RA's motion in time, with the width of its average: a rest of one width before its start, path pieces of constant s̈, and a rest
/// of one width after its end.
#[derive(Clone, Debug, Default)]
pub(crate) struct TimedPath {
    width: f64,
    /// A braking to the path's begin, which is added to the path.
    braking: Option<Braking>,
    /// When each piece begins, and when the last one ends, s; the path begins at 0.
    time: Vec<f64>,
    piece: Vec<TimedPiece>,
    /// How much s̈ changes at the begin of each piece of the path and at the path's end, rad/s².
    path_acceleration_step: Vec<f64>,
}

/// A piece of the path on which ζ is cubic in s and s is quadratic in time.
#[derive(Clone, Copy, Debug)]
struct TimedPiece {
    /// ṡ at the piece's start, rad/s.
    speed: f64,
    /// s̈ on the piece, rad/s².
    path_acceleration: f64,
    start: PathPoint,
    /// ∫ (ζ − ζ at the start) dt over the piece.
    area: Configuration,
}

impl TimedPiece {
    /// A rest at `position`, rad.
    fn resting(position: Configuration) -> Self {
        let zero = Configuration::zeros();
        Self {
            speed: 0.0,
            path_acceleration: 0.0,
            start: PathPoint {
                position,
                slope: zero,
                bend: zero,
                third_derivative: zero,
            },
            area: zero,
        }
    }

    fn position(&self, elapsed: f64) -> Configuration {
        self.start.position + self.displacement(self.advance(elapsed))
    }

    fn advance(&self, elapsed: f64) -> f64 {
        elapsed * (self.speed + 0.5 * self.path_acceleration * elapsed)
    }

    fn displacement(&self, s: f64) -> Configuration {
        self.start.weighted([s, s * s / 2.0, s * s * s / 6.0])
    }

    fn velocity(&self, elapsed: f64) -> Configuration {
        let s = self.advance(elapsed);
        let speed = self.speed + self.path_acceleration * elapsed;
        self.start.weighted([speed, s * speed, s * s * speed / 2.0])
    }

    /// ∫ (ζ − ζ at the start) dt over the first `elapsed` seconds: the powers of s, integrated over time.
    fn area_until(&self, elapsed: f64) -> Configuration {
        let t = elapsed;
        let (v, w) = (self.speed * t, 0.5 * self.path_acceleration * t * t);
        let first = v / 2.0 + w / 3.0;
        let second = v * v / 3.0 + v * w / 2.0 + w * w / 5.0;
        let third = v * v * v / 4.0 + v * v * w * 0.6 + v * w * w / 2.0 + w * w * w / 7.0;
        self.start
            .weighted([t * first, t * second / 2.0, t * third / 6.0])
    }
}

impl TimedPath {
    /// Integrates ds/√x; false if the motion takes forever (no speed on a whole interval).
    ///
    /// [`TimedPath::set_average`] must follow.
    pub(crate) fn rebuild(&mut self, spline: &Spline, profile: &SpeedProfile) -> bool {
        let (grid, square) = (profile.grid(), profile.square_speeds());
        let last = grid[grid.len() - 1];
        let [first, last] = [grid[0], last].map(|at| spline.at(at.piece, at.parameter).position);
        self.time.clear();
        self.piece.clear();
        self.path_acceleration_step.clear();
        self.time.push(0.0);
        self.piece.push(TimedPiece::resting(first));
        self.braking = None;
        let (mut time, mut speed) = (profile.begin(), square[0].sqrt());
        let mut path_acceleration_before = 0.0;
        for (pair, squares) in grid.windows(2).zip(square.windows(2)) {
            let step = pair[1].parameter - pair[0].parameter;
            let next_speed = squares[1].sqrt();
            let elapsed = 2.0 * step / (speed + next_speed);
            let path_acceleration = (next_speed - speed) / elapsed;
            let mut piece = TimedPiece {
                speed,
                path_acceleration,
                start: spline.at(pair[0].piece, pair[0].parameter),
                area: Configuration::zeros(),
            };
            piece.area = piece.area_until(elapsed);
            self.piece.push(piece);
            self.time.push(time);
            self.path_acceleration_step
                .push(path_acceleration - path_acceleration_before);
            (time, speed, path_acceleration_before) =
                (time + elapsed, next_speed, path_acceleration);
        }
        self.time.extend([time, time]);
        self.piece.push(TimedPiece::resting(last));
        self.path_acceleration_step.push(-path_acceleration_before);
        time.is_finite()
    }

    /// Adds a braking, averaged over its own width, that comes to rest where the path begins.
    pub(crate) fn add_braking(&mut self, braking: &Braking) {
        self.braking = Some(*braking);
    }

    /// When the jerk of the averaged braking steps, s; nothing where there is none.
    pub(crate) fn braking_times(&self) -> impl Iterator<Item = f64> + '_ {
        let duration = self.braking.map(|braking| braking.duration);
        let times = duration.map(|duration| [self.width, duration, duration + self.width]);
        times.into_iter().flatten()
    }

    /// Sets the width of the average, s.
    pub(crate) fn set_average(&mut self, width: f64) {
        let after = self.piece.len() - 1;
        self.width = width;
        self.time[0] = -width;
        self.time[after + 1] = self.time[after] + width;
    }

    /// Width of the average, s.
    pub(crate) fn width(&self) -> f64 {
        self.width
    }

    /// Seconds from the path's start to its end; 0 if empty.
    pub(crate) fn duration(&self) -> f64 {
        self.times().last().copied().unwrap_or(0.0)
    }

    /// When each piece of the path begins, and when the last one ends, before averaging, s.
    pub(crate) fn times(&self) -> &[f64] {
        self.time
            .get(1..self.time.len().saturating_sub(1))
            .unwrap_or_default()
    }

    /// s̈ of each piece of the path, rad/s².
    pub(crate) fn path_accelerations(&self) -> impl Iterator<Item = f64> + '_ {
        self.piece[1..self.piece.len() - 1]
            .iter()
            .map(|piece| piece.path_acceleration)
    }

    /// The times at which s̈ changes, before averaging, s, with the changes, rad/s².
    pub(crate) fn path_acceleration_steps(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        let times = self.times().iter().copied();
        times.zip(self.path_acceleration_step.iter().copied())
    }

    /// The largest norm of a position, rad.
    pub(crate) fn largest_position(&self) -> f64 {
        let starts = self
            .piece
            .iter()
            .map(|piece| piece.start.position.norm_squared());
        starts.fold(0.0, f64::max).sqrt()
    }

    /// The piece that holds `time`, s.
    fn index(&self, time: f64) -> usize {
        let after = self.time.partition_point(|&start| start <= time);
        after.clamp(1, self.piece.len()) - 1
    }

    /// The pieces that hold the first and the last instant that the average at `time`, s, is over.
    fn span(&self, time: f64) -> [usize; 2] {
        let first = self.index(time - self.width);
        let later = &self.time[first + 1..self.piece.len()];
        let passed = later.iter().take_while(|&&start| start <= time).count();
        [first, first + passed]
    }

    /// Position, rad, and velocity, rad/s, at `time`, s, in piece `i`.
    fn state(&self, i: usize, time: f64) -> (Configuration, Configuration) {
        let elapsed = time - self.time[i];
        (
            self.piece[i].position(elapsed),
            self.piece[i].velocity(elapsed),
        )
    }

    /// Position of the averaged motion at `time`, rad.
    pub(crate) fn mean_position(&self, time: f64) -> Configuration {
        let mean = self.mean_position_over(self.span(time), time);
        let braking = self.braking.as_ref();
        braking.map_or(mean, |braking| mean + braking.before_rest(time).position)
    }

    /// Position of the averaged motion at `time` over the pieces `first` to `last`; differences to a near position are summed, which
    /// keeps rounding small.
    fn mean_position_over(&self, [first, last]: [usize; 2], time: f64) -> Configuration {
        let (from, to) = ((time - self.width).max(self.time[0]), time);
        let reference = self.piece[first].start.position;
        let mut area = Configuration::zeros();
        for i in first..=last {
            let piece = &self.piece[i];
            let (begin, finish) = (self.time[i], self.time[i + 1]);
            let (start, stop) = (begin.max(from), finish.min(to));
            area += if stop == finish {
                piece.area
            } else {
                piece.area_until(stop - begin)
            };
            if start > begin {
                area -= piece.area_until(start - begin);
            }
            area += (piece.start.position - reference) * (stop - start);
        }
        reference + area / self.width
    }

    /// The averaged motion, which lasts duration + width, at `time`, s.
    pub(crate) fn averaged(&self, time: f64) -> Knot {
        let [early, late] = self.span(time);
        let (late_position, late_velocity) = self.state(late, time);
        let (early_position, early_velocity) = self.state(early, time - self.width);
        let path = Knot {
            time,
            position: self.mean_position_over([early, late], time),
            velocity: (late_position - early_position) / self.width,
            acceleration: (late_velocity - early_velocity) / self.width,
        };
        let braking = self.braking.as_ref();
        braking.map_or(path, |braking| sum(&path, &braking.before_rest(time)))
    }
}

/// The sum of two motions at the first one's time.
fn sum(first: &Knot, second: &Knot) -> Knot {
    Knot {
        time: first.time,
        position: first.position + second.position,
        velocity: first.velocity + second.velocity,
        acceleration: first.acceleration + second.acceleration,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::limits::tendon_rows::TendonRows;
    use crate::parameterize::topp::Grid;
    use crate::test_paths::{smooth_path, unit_limits, unit_tendons};
    use rand::SeedableRng;

    const WIDTH: f64 = 0.2;

    fn with_motion(check: impl Fn(&TimedPath, &TendonRows)) {
        let rows = TendonRows::of(&unit_tendons());
        let mut random = rand_pcg::Pcg64::seed_from_u64(31);
        for _ in 0..10 {
            let (mut spline, mut profile) = (Spline::default(), SpeedProfile::default());
            let mut timed = TimedPath::default();
            assert!(spline.rebuild(&smooth_path(&mut random, 64), 0.1, 0.0));
            let solved = profile.solve(&spline, &rows, &unit_limits(), Grid::refined(128), None);
            assert!(solved);
            assert!(timed.rebuild(&spline, &profile));
            timed.set_average(WIDTH);
            check(&timed, &rows);
        }
    }

    #[test]
    fn averaging_keeps_bounds_and_bounds_jerk() {
        let limits = unit_limits();
        with_motion(|motion, rows| {
            let step = (motion.duration() + WIDTH) / 2000.0;
            let mut before = motion.averaged(0.0);
            for i in 1..=2000 {
                let here = motion.averaged(step * f64::from(i));
                assert!(rows.largest(&here.velocity) <= limits.velocity * 1.01);
                assert!(rows.largest(&here.acceleration) <= limits.acceleration * 1.02);
                let jerk = rows.largest(&(here.acceleration - before.acceleration)) / step;
                assert!(jerk <= 2.0 * limits.acceleration / WIDTH * 1.02, "{jerk}");
                before = here;
            }
        });
    }

    #[test]
    fn position_velocity_and_acceleration_belong_together() {
        with_motion(|motion, _| {
            let step = 1e-5;
            for i in 0..200 {
                let time = (motion.duration() + WIDTH) * (f64::from(i) + 0.5) / 200.0;
                let [before, here, after] = [-step, 0.0, step].map(|d| motion.averaged(time + d));
                let slope = |a: Configuration, b: Configuration| (b - a) / (2.0 * step);
                let velocity = slope(before.position, after.position);
                assert!(
                    (velocity - here.velocity).amax() < 1e-8,
                    "{}",
                    velocity - here.velocity
                );
                let acceleration = slope(before.velocity, after.velocity);
                assert!((acceleration - here.acceleration).amax() < 1e-3);
            }
        });
    }

    #[test]
    fn it_starts_and_ends_at_rest_at_the_ends() {
        with_motion(|motion, _| {
            let total = motion.duration() + WIDTH;
            for (knot, expected) in [
                (
                    motion.averaged(0.0),
                    Knot::resting(0.0, motion.piece[0].start.position),
                ),
                (
                    motion.averaged(total),
                    Knot::resting(total, motion.piece[motion.piece.len() - 1].start.position),
                ),
            ] {
                assert!((knot.position - expected.position).amax() < 1e-13);
                assert!(knot.velocity.amax() < 1e-12 && knot.acceleration.amax() < 1e-9);
            }
        });
    }
}
