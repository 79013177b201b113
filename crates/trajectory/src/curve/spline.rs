//! The geometric path: a C2 cubic spline through the waypoints, by chord length.

use pcc_model::Configuration;

/// Waypoints nearer to each other than this part of the path's extent are merged: the tight turns of a C2 curve
/// between them would bring the motion almost to a stop.
const MERGE: f64 = 1e-4;

/// A natural cubic spline ζ(s), C2, through its nodes; s is the length of the polyline through them, rad.
///
/// Deviation from that polyline: with chords h_i and direction changes δ_i (difference of unit chord vectors) the
/// second derivatives at the nodes are at most `6 max |δ_k| / (h_{k−1} + h_k)` (the system is diagonally
/// dominant), so on chord i the spline stays within `¾ h_i² max_k |δ_k| / (h_{k−1} + h_k)` of the chord: for equal
/// chords 0.375 h |δ|, at a lone corner in truth 0.08 h |δ|. It falls linearly with the spacing, hence `spacing`.
#[derive(Clone, Debug, Default)]
pub(crate) struct Spline {
    parameter: Vec<f64>,
    point: Vec<Configuration>,
    bend: Vec<Configuration>,
    elimination: Vec<f64>,
    kept: Vec<Configuration>,
}

/// A place on the path with its first three derivatives by s.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PathPoint {
    pub(crate) position: Configuration,
    pub(crate) slope: Configuration,
    pub(crate) bend: Configuration,
    pub(crate) third_derivative: Configuration,
}

impl PathPoint {
    /// The sum of the three derivatives, each multiplied by its weight.
    #[inline]
    pub(crate) fn weighted(&self, [slope, bend, third]: [f64; 3]) -> Configuration {
        self.slope * slope + self.bend * bend + self.third_derivative * third
    }
}

impl Spline {
    /// Rebuilds the spline through `waypoints`, reusing its memory; false if they do not move: none is farther
    /// from the first than `rounding` × the largest norm of a waypoint.
    ///
    /// A waypoint closer to the one before it than 1e-4 of the farthest one's distance from the first is skipped
    /// (the last one never: it takes the place of the one before), and chords longer than `spacing` rad are
    /// divided evenly, into 1000 at most.
    pub(crate) fn rebuild(
        &mut self,
        waypoints: &[Configuration],
        spacing: f64,
        rounding: f64,
    ) -> bool {
        self.parameter.clear();
        self.point.clear();
        let (Some(&first), Some(&last)) = (waypoints.first(), waypoints.last()) else {
            return false;
        };
        let largest_of =
            |size: &dyn Fn(&Configuration) -> f64| waypoints.iter().map(size).fold(0.0, f64::max);
        let extent = largest_of(&|point| (point - first).norm());
        if extent <= rounding * largest_of(&|point| point.norm()) {
            return false;
        }
        self.keep_apart(waypoints, last, MERGE * extent);
        self.push(0.0, first);
        let kept = std::mem::take(&mut self.kept);
        for pair in kept.windows(2) {
            self.chord(pair[0], pair[1], spacing);
        }
        self.kept = kept;
        self.solve();
        true
    }

    /// Sets `kept` to the waypoints that are farther than `merge` (rad) from the one before, and `last`.
    fn keep_apart(&mut self, waypoints: &[Configuration], last: Configuration, merge: f64) {
        let far = |from: &Configuration, to: &Configuration| (to - from).norm() > merge;
        self.kept.clear();
        for &point in waypoints {
            if self.kept.last().is_none_or(|before| far(before, &point)) {
                self.kept.push(point);
            }
        }
        while self.kept.len() > 1 && self.kept.last().is_some_and(|before| !far(before, &last)) {
            self.kept.pop();
        }
        self.kept.push(last);
    }

    fn push(&mut self, parameter: f64, point: Configuration) {
        self.parameter.push(parameter);
        self.point.push(point);
    }

    /// Adds nodes along the chord, without `from` and with `to`, at most `spacing` (rad) apart (1000 parts at most).
    fn chord(&mut self, from: Configuration, to: Configuration, spacing: f64) {
        let length = (to - from).norm();
        let parts = (length / spacing).ceil().clamp(1.0, 1000.0);
        let start = self.length();
        for part in 1..parts as usize {
            let fraction = part as f64 / parts;
            self.push(start + length * fraction, from + (to - from) * fraction);
        }
        self.push(start + length, to);
    }

    /// Solves the tridiagonal system for the second derivatives at the nodes, by elimination; they are zero at both ends.
    fn solve(&mut self) {
        let last = self.point.len() - 1;
        self.bend.clear();
        self.bend.resize(last + 1, Configuration::zeros());
        self.elimination.clear();
        self.elimination.resize(last + 1, 0.0);
        for i in 1..last {
            let before = self.parameter[i] - self.parameter[i - 1];
            let after = self.parameter[i + 1] - self.parameter[i];
            let kink = self.chord_slope(i) - self.chord_slope(i - 1);
            let pivot = 2.0 * (before + after) - before * self.elimination[i - 1];
            self.elimination[i] = after / pivot;
            self.bend[i] = (kink * 6.0 - self.bend[i - 1] * before) / pivot;
        }
        for i in (0..last).rev() {
            let next = self.bend[i + 1];
            self.bend[i] -= next * self.elimination[i];
        }
    }

    fn chord_slope(&self, piece: usize) -> Configuration {
        let length = self.parameter[piece + 1] - self.parameter[piece];
        (self.point[piece + 1] - self.point[piece]) / length
    }

    /// Length of the polyline, rad; 0 if empty.
    pub(crate) fn length(&self) -> f64 {
        self.parameter.last().copied().unwrap_or(0.0)
    }

    /// The values of s at the nodes, increasing from 0.
    pub(crate) fn parameters(&self) -> &[f64] {
        &self.parameter
    }

    /// Slopes dζ/ds of the chords, piece by piece.
    pub(crate) fn chords(&self) -> impl Iterator<Item = Configuration> + '_ {
        (1..self.point.len()).map(|node| self.chord_slope(node - 1))
    }

    /// Second derivatives d²ζ/ds² at the nodes, 1/rad; they are linear between nodes.
    pub(crate) fn bends(&self) -> &[Configuration] {
        &self.bend
    }

    /// The path at `parameter` on piece `piece` (between nodes `piece` and `piece` + 1).
    #[inline]
    pub(crate) fn at(&self, piece: usize, parameter: f64) -> PathPoint {
        let (s0, s1) = (self.parameter[piece], self.parameter[piece + 1]);
        let (p0, p1) = (self.point[piece], self.point[piece + 1]);
        let (m0, m1) = (self.bend[piece], self.bend[piece + 1]);
        let h = s1 - s0;
        let b = ((parameter - s0) / h).clamp(0.0, 1.0);
        let a = 1.0 - b;
        let sixth = h * h / 6.0;
        PathPoint {
            position: p0 * a
                + p1 * b
                + m0 * (sixth * (a * a * a - a))
                + m1 * (sixth * (b * b * b - b)),
            slope: (p1 - p0) / h
                + m0 * (h / 6.0 * (1.0 - 3.0 * a * a))
                + m1 * (h / 6.0 * (3.0 * b * b - 1.0)),
            bend: m0 * a + m1 * b,
            third_derivative: (m1 - m0) / h,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(x: f64, y: f64) -> Configuration {
        Configuration::from_row_slice(&[x, y, 0.0, 0.0, 0.0, 0.0])
    }

    fn through(waypoints: &[Configuration], spacing: f64) -> Spline {
        let mut spline = Spline::default();
        assert!(spline.rebuild(waypoints, spacing, 1e-11));
        spline
    }

    #[test]
    fn nodes_are_met_and_derivatives_are_continuous() {
        let waypoints: Vec<_> = (0..12)
            .map(|i| point((0.9 * f64::from(i)).sin(), 0.2 * f64::from(i)))
            .collect();
        let spline = through(&waypoints, 10.0);
        for (i, waypoint) in waypoints.iter().enumerate().skip(1).take(10) {
            let s = spline.parameters()[i];
            let (left, right) = (spline.at(i - 1, s), spline.at(i, s));
            assert!(
                (left.position - waypoint).norm() < 1e-15
                    && (right.position - waypoint).norm() < 1e-15
            );
            assert!((left.slope - right.slope).norm() < 1e-13);
            assert!((left.bend - right.bend).norm() < 1e-12);
        }
    }

    #[test]
    fn repeated_waypoints_are_merged_and_both_ends_are_kept() {
        let (a, b, c) = (point(0.0, 0.0), point(1.0, 0.0), point(1.0, 1.0));
        let spline = through(&[a, a, b, b, b, c, c], 10.0);
        assert_eq!(spline.point, vec![a, b, c]);
        let back = through(&[a, b, a], 10.0);
        assert_eq!(back.point, vec![a, b, a]);
        let almost = c + point(1e-9, 0.0);
        assert_eq!(through(&[a, b, almost, c], 10.0).point, vec![a, b, c]);
        let mut still = Spline::default();
        assert!(
            !still.rebuild(&[b, b], 10.0, 0.0)
                && !still.rebuild(&[b], 10.0, 0.0)
                && !still.rebuild(&[], 10.0, 0.0)
        );
    }

    #[test]
    fn a_corner_stays_within_the_bound_and_finer_spacing_is_closer() {
        let corner = [point(0.0, 0.0), point(1.0, 0.0), point(1.0, 1.0)];
        let mut before = f64::INFINITY;
        for spacing in [0.5, 0.1, 0.02] {
            let spline = through(&corner, spacing);
            let nodes = spline.parameters();
            let deviation = (0..nodes.len() - 1)
                .flat_map(|i| (0..=20).map(move |k| (i, f64::from(k) / 20.0)))
                .map(|(i, u)| {
                    let chord = spline.point[i] * (1.0 - u) + spline.point[i + 1] * u;
                    (spline
                        .at(i, nodes[i] + u * (nodes[i + 1] - nodes[i]))
                        .position
                        - chord)
                        .norm()
                })
                .fold(0.0, f64::max);
            assert!(
                deviation > 0.05 * spacing && deviation < 0.13 * spacing,
                "{deviation} at {spacing}"
            );
            assert!(deviation < before);
            before = deviation;
        }
    }
}
