//! A bound on jerk: a moving average in time over the fastest motion.
//!
//! The motion q(t) of TOPP-RA has steps of acceleration. Its average over the last τ seconds,
//! `(1/τ) ∫ q(t − r) dr, r in 0..τ`, with q at rest before its start and after its end, starts and ends at rest
//! at the same points, keeps every bound on tendon velocity v and acceleration a (it averages them too), bounds
//! the jerk by 2a/τ, takes τ longer, and leaves the path by about q̈ τ²/24.

use crate::Knot;
use crate::spline::Spline;
use crate::topp::SpeedProfile;
use pcc_model::Configuration;

/// TOPP-RA's motion in time: at each grid point the time and the running integral of position.
#[derive(Clone, Debug, Default)]
pub(crate) struct TimedPath {
    time: Vec<f64>,
    speed: Vec<f64>,
    /// ∫ (ζ − ζ at the interval's start) dt over each interval.
    area: Vec<Configuration>,
    position: Vec<Configuration>,
}

/// Nodes and weights on 0..1 of Gauss's rule that is exact to degree 7; position is of degree 6 in time.
const GAUSS: [(f64, f64); 4] = [
    (0.069_431_844_202_973_71, 0.173_927_422_568_726_93),
    (0.330_009_478_207_571_9, 0.326_072_577_431_273_07),
    (0.669_990_521_792_428_1, 0.326_072_577_431_273_07),
    (0.930_568_155_797_026_3, 0.173_927_422_568_726_93),
];

/// A timed path with what it is made of.
#[derive(Clone, Copy)]
pub(crate) struct Motion<'a> {
    pub(crate) spline: &'a Spline,
    pub(crate) profile: &'a SpeedProfile,
    pub(crate) timed: &'a TimedPath,
}

impl TimedPath {
    /// Integrates ds/√x; false if the motion takes forever (no speed on a whole interval).
    pub(crate) fn rebuild(&mut self, spline: &Spline, profile: &SpeedProfile) -> bool {
        let (grid, square) = (profile.grid(), profile.square_speeds());
        self.time.clear();
        self.speed.clear();
        self.position.clear();
        self.area.clear();
        let mut time = 0.0;
        for i in 0..grid.len() {
            self.time.push(time);
            self.speed.push(square[i].sqrt());
            self.position
                .push(spline.position(grid[i].piece, grid[i].parameter));
            if i + 1 < grid.len() {
                let step = grid[i + 1].parameter - grid[i].parameter;
                time += 2.0 * step / (square[i].sqrt() + square[i + 1].sqrt());
            }
        }
        if !time.is_finite() {
            return false;
        }
        for i in 0..grid.len() - 1 {
            let area = Motion {
                spline,
                profile,
                timed: self,
            }
            .area_within(i, self.time[i], self.time[i + 1]);
            self.area.push(area);
        }
        true
    }

    /// Seconds from start to end; 0 if empty.
    pub(crate) fn duration(&self) -> f64 {
        self.time.last().copied().unwrap_or(0.0)
    }
}

impl Motion<'_> {
    /// Duration before averaging, s.
    pub(crate) fn duration(&self) -> f64 {
        self.timed.duration()
    }

    /// The times of the grid points, before averaging, s.
    pub(crate) fn times(&self) -> &[f64] {
        &self.timed.time
    }

    /// The largest norm of a position, rad.
    pub(crate) fn largest_position(&self) -> f64 {
        self.timed
            .position
            .iter()
            .map(nalgebra::Matrix::norm)
            .fold(0.0, f64::max)
    }

    /// The first knot of the averaged motion.
    pub(crate) fn start(&self) -> Knot {
        Knot::resting(0.0, self.timed.position[0])
    }

    /// The last knot of the motion averaged over `width` seconds.
    pub(crate) fn end(&self, width: f64) -> Knot {
        Knot::resting(
            self.duration() + width,
            self.timed.position[self.timed.position.len() - 1],
        )
    }

    /// Path parameter and speed at `time` in interval `i`.
    fn parameter(&self, i: usize, time: f64) -> (f64, f64) {
        let (t0, t1) = (self.timed.time[i], self.timed.time[i + 1]);
        let (v0, v1) = (self.timed.speed[i], self.timed.speed[i + 1]);
        let elapsed = (time - t0).clamp(0.0, t1 - t0);
        let slope = (v1 - v0) / (t1 - t0);
        let speed = v0 + slope * elapsed;
        (
            self.profile.grid()[i].parameter + 0.5 * (v0 + speed) * elapsed,
            speed,
        )
    }

    /// The interval that holds `time`.
    fn interval(&self, time: f64) -> usize {
        let after = self.timed.time.partition_point(|&start| start <= time);
        after.clamp(1, self.timed.time.len() - 1) - 1
    }

    /// Position and velocity at `time`; at rest outside the motion.
    fn state(&self, time: f64) -> (Configuration, Configuration) {
        if time <= 0.0 {
            return (self.timed.position[0], Configuration::zeros());
        }
        if time >= self.timed.duration() {
            return (
                self.timed.position[self.timed.position.len() - 1],
                Configuration::zeros(),
            );
        }
        let i = self.interval(time);
        let (parameter, speed) = self.parameter(i, time);
        let path = self.spline.at(self.profile.grid()[i].piece, parameter);
        (path.position, path.slope * speed)
    }

    /// Path derivative by time twice, from the left and the right of grid point `i`.
    fn acceleration(&self, i: usize, place: usize) -> Configuration {
        let (t0, t1) = (self.timed.time[i], self.timed.time[i + 1]);
        let (v0, v1) = (self.timed.speed[i], self.timed.speed[i + 1]);
        let path = self.spline.at(
            self.profile.grid()[i].piece,
            self.profile.grid()[place].parameter,
        );
        let speed = self.timed.speed[place];
        path.slope * ((v1 - v0) / (t1 - t0)) + path.bend * (speed * speed)
    }

    /// The step of acceleration at grid point `i`, rad/s².
    pub(crate) fn acceleration_step(&self, i: usize) -> Configuration {
        let last = self.timed.time.len() - 1;
        let before = if i == 0 {
            Configuration::zeros()
        } else {
            self.acceleration(i - 1, i)
        };
        let after = if i == last {
            Configuration::zeros()
        } else {
            self.acceleration(i, i)
        };
        after - before
    }

    /// ∫ (ζ − ζ at the start of interval `i`) dt between two times in interval `i`.
    fn area_within(&self, i: usize, from: f64, to: f64) -> Configuration {
        let piece = self.profile.grid()[i].piece;
        let reference = self.timed.position[i];
        let mut area = Configuration::zeros();
        for (node, weight) in GAUSS {
            let (parameter, _) = self.parameter(i, from + node * (to - from));
            area += (self.spline.position(piece, parameter) - reference) * (weight * (to - from));
        }
        area
    }

    /// The mean of position over `from`..`to`, at rest outside the motion. Sums differences to a near position.
    fn mean_position(&self, from: f64, to: f64) -> Configuration {
        let end = self.timed.duration();
        let last = self.timed.position[self.timed.position.len() - 1];
        let (inner_from, inner_to) = (from.clamp(0.0, end), to.clamp(0.0, end));
        let (first_interval, last_interval) = (self.interval(inner_from), self.interval(inner_to));
        let reference = self.timed.position[first_interval];
        let mut area = (self.timed.position[0] - reference) * (inner_from - from)
            + (last - reference) * (to - inner_to);
        for i in first_interval..=last_interval {
            let start = self.timed.time[i].max(inner_from);
            let stop = self.timed.time[i + 1].min(inner_to);
            let whole = start == self.timed.time[i] && stop == self.timed.time[i + 1];
            area += if whole {
                self.timed.area[i]
            } else {
                self.area_within(i, start, stop)
            };
            area += (self.timed.position[i] - reference) * (stop - start);
        }
        reference + area / (to - from)
    }

    /// Position alone of [`Motion::averaged`].
    pub(crate) fn mean_position_until(&self, time: f64, width: f64) -> Configuration {
        self.mean_position(time - width, time)
    }

    /// The averaged motion, of length duration + `width`, at `time`.
    pub(crate) fn averaged(&self, width: f64, time: f64) -> Knot {
        let (late_position, late_velocity) = self.state(time);
        let (early_position, early_velocity) = self.state(time - width);
        Knot {
            time,
            position: self.mean_position(time - width, time),
            velocity: (late_position - early_position) / width,
            acceleration: (late_velocity - early_velocity) / width,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tendon::TendonRows;
    use crate::test_paths::{smooth_path, unit_limits, unit_tendons};
    use crate::topp::EndSpeeds;
    use rand::SeedableRng;

    const WIDTH: f64 = 0.2;

    fn with_motion(check: impl Fn(Motion, &TendonRows)) {
        let rows = TendonRows::of(&unit_tendons());
        let mut random = rand_pcg::Pcg64::seed_from_u64(31);
        for _ in 0..10 {
            let (mut spline, mut profile) = (Spline::default(), SpeedProfile::default());
            let mut timed = TimedPath::default();
            assert!(spline.rebuild(&smooth_path(&mut random, 64), 0.1, 0.0));
            assert!(profile.solve(&spline, &rows, &unit_limits(), EndSpeeds::default(), 128));
            assert!(timed.rebuild(&spline, &profile));
            check(
                Motion {
                    spline: &spline,
                    profile: &profile,
                    timed: &timed,
                },
                &rows,
            );
        }
    }

    #[test]
    fn averaging_keeps_bounds_and_bounds_jerk() {
        let limits = unit_limits();
        with_motion(|motion, rows| {
            let step = (motion.duration() + WIDTH) / 2000.0;
            let mut before = motion.averaged(WIDTH, 0.0);
            for i in 1..=2000 {
                let here = motion.averaged(WIDTH, step * f64::from(i));
                for row in rows.iter() {
                    assert!(row.dot(&here.velocity).abs() <= limits.velocity * 1.01);
                    assert!(row.dot(&here.acceleration).abs() <= limits.acceleration * 1.02);
                    let jerk = row.dot(&(here.acceleration - before.acceleration)).abs() / step;
                    assert!(jerk <= 2.0 * limits.acceleration / WIDTH * 1.02, "{jerk}");
                }
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
                let [before, here, after] =
                    [-step, 0.0, step].map(|d| motion.averaged(WIDTH, time + d));
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
                (motion.averaged(WIDTH, 0.0), motion.start()),
                (motion.averaged(WIDTH, total), motion.end(WIDTH)),
            ] {
                assert!((knot.position - expected.position).amax() < 1e-13);
                assert!(knot.velocity.amax() < 1e-12 && knot.acceleration.amax() < 1e-9);
            }
        });
    }
}
