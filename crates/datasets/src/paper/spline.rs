//! A smooth tip line through a path that was pushed: Douglas–Peucker, clamped cubic B-spline, even arc length.

use pcc_model::Point;
use planning::WAYPOINTS;

/// Distance that a left-out tip may have from the simplified line, section lengths.
const SIMPLIFY: f64 = 0.1;
/// Control points at least: those of one cubic.
const FEWEST: usize = 4;
/// Chords by which the arc length is measured.
const CHORDS: usize = 1024;

/// Room for one line.
pub(super) struct LineSmoother {
    kept: Vec<usize>,
    open: Vec<(usize, usize)>,
    curve: Vec<Point>,
}

impl LineSmoother {
    pub(super) fn new() -> Self {
        Self {
            kept: Vec::with_capacity(WAYPOINTS),
            open: Vec::with_capacity(WAYPOINTS),
            curve: Vec::with_capacity(CHORDS + 1),
        }
    }

    /// Replaces the tips of a path by a smooth line between the same ends, even in arc length.
    pub(super) fn smooth(&mut self, tips: &mut [Point; WAYPOINTS]) {
        self.simplify(tips);
        self.draw(tips);
        self.resample(tips);
    }

    /// Chooses the tips that keep the line within [`SIMPLIFY`], then halves the widest gaps until there are enough.
    fn simplify(&mut self, tips: &[Point; WAYPOINTS]) {
        self.kept.clear();
        self.kept.extend([0, WAYPOINTS - 1]);
        self.open.clear();
        self.open.push((0, WAYPOINTS - 1));
        while let Some((first, last)) = self.open.pop() {
            if let Some(farthest) = farthest(tips, first, last) {
                self.kept.push(farthest);
                self.open.extend([(first, farthest), (farthest, last)]);
            }
        }
        self.kept.sort_unstable();
        while self.kept.len() < FEWEST {
            let gap = |i: &usize| self.kept[i + 1] - self.kept[*i];
            let ends = 0..self.kept.len() - 1;
            let widest = ends.rev().max_by_key(gap).unwrap_or(0);
            let middle = (self.kept[widest] + self.kept[widest + 1]) / 2;
            self.kept.insert(widest + 1, middle);
        }
    }

    /// Fills `curve` with points of the spline at even parameters.
    fn draw(&mut self, tips: &[Point; WAYPOINTS]) {
        let spans = self.kept.len() - 3;
        self.curve.clear();
        for i in 0..=CHORDS {
            let along = i as f64 * spans as f64 / CHORDS as f64;
            let span = (along as usize).min(spans - 1);
            let control = [0, 1, 2, 3].map(|k| tips[self.kept[span + k]]);
            self.curve.push(de_boor(control, span, spans, along));
        }
    }

    fn resample(&self, tips: &mut [Point; WAYPOINTS]) {
        let chords = || self.curve.windows(2).map(|w| (w[1] - w[0]).norm());
        let total: f64 = chords().sum();
        let (mut passed, mut frame) = (0.0, 1);
        for (chord, length) in chords().enumerate() {
            while frame < WAYPOINTS - 1 {
                let wanted = total * frame as f64 / (WAYPOINTS - 1) as f64;
                if wanted > passed + length {
                    break;
                }
                let fraction = (wanted - passed) / length.max(f64::MIN_POSITIVE);
                tips[frame] = self.curve[chord].lerp(&self.curve[chord + 1], fraction);
                frame += 1;
            }
            passed += length;
        }
    }
}

/// The tip between two others that is farthest from the segment between them, if it is too far.
fn farthest(tips: &[Point; WAYPOINTS], first: usize, last: usize) -> Option<usize> {
    let (base, along) = (tips[first], tips[last] - tips[first]);
    let squared_length = along.norm_squared().max(f64::MIN_POSITIVE);
    let squared_distance = |i: usize| {
        let from_base = tips[i] - base;
        let fraction = (from_base.dot(&along) / squared_length).clamp(0.0, 1.0);
        (from_base - along * fraction).norm_squared()
    };
    let mut worst = (SIMPLIFY * SIMPLIFY, None);
    for i in first + 1..last {
        let here = squared_distance(i);
        if here > worst.0 {
            worst = (here, Some(i));
        }
    }
    worst.1
}

/// The clamped uniform cubic B-spline of unit spans at `along`, from the four control points of its span.
fn de_boor(mut control: [Point; 4], span: usize, spans: usize, along: f64) -> Point {
    let knot = |i: usize| (i.max(3) - 3).min(spans) as f64;
    for level in 1..4 {
        for k in (level..4).rev() {
            let (left, right) = (knot(span + k), knot(span + k + 4 - level));
            let fraction = (along - left) / (right - left);
            control[k] = control[k - 1].lerp(&control[k], fraction);
        }
    }
    control[3]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tips(point: impl Fn(f64) -> Point) -> [Point; WAYPOINTS] {
        std::array::from_fn(|h| point(h as f64 / 63.0))
    }

    #[test]
    fn a_straight_line_stays_and_becomes_even() {
        let mut line = tips(|u| Point::new(u * u, 0.0, 2.0));
        let mut smoother = LineSmoother::new();
        smoother.smooth(&mut line);
        assert_eq!(
            smoother.kept,
            [0, 31, 47, 63],
            "gaps are halved, the widest first"
        );
        for (h, tip) in line.iter().enumerate() {
            assert!((tip - Point::new(h as f64 / 63.0, 0.0, 2.0)).norm() < 1e-9);
        }
    }

    #[test]
    fn a_bump_is_kept_and_rounded() {
        let bump = |u: f64| Point::new(u, (1.0 - (10.0 * u - 5.0).abs()).max(0.0), 2.0);
        let mut line = tips(bump);
        let ends = [line[0], line[63]];
        let mut smoother = LineSmoother::new();
        smoother.smooth(&mut line);
        assert!(smoother.kept.len() > FEWEST);
        assert_eq!([line[0], line[63]], ends);
        let top = line.iter().map(|tip| tip.y).fold(0.0, f64::max);
        assert!((0.2..0.9).contains(&top), "{top}");
        let steps: Vec<f64> = line.windows(2).map(|w| (w[1] - w[0]).norm()).collect();
        let longest = steps.iter().copied().fold(0.0, f64::max);
        assert!(steps.iter().all(|step| *step > 0.8 * longest), "{steps:?}");
    }

    #[test]
    fn the_spline_of_a_cubic_is_its_bezier_curve() {
        let control = [0.0, 1.0, 3.0, 2.0].map(|x| Point::new(x, 0.0, 0.0));
        let middle = de_boor(control, 0, 1, 0.5);
        assert!((middle.x - (3.0 * 1.0 + 3.0 * 3.0 + 2.0) / 8.0).abs() < 1e-15);
    }
}
