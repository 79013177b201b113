//! How far body points can move when the configuration changes, and how far from a straight line (docs/robot.md "A certificate for whole motions").

use crate::distance::passage::Passage;
use pcc_model::{Backbone, Configuration, Point, Robot, SECTIONS};
use trajectory::QuinticSegment;

/// Upper bounds Λ_k of how far any point of each section moves while the bending pairs turn by `turns`, rad.
///
/// With p = L ∫₀^σ exp(u ξ̂) e₃ du and a right Jacobian of SO(3) of norm at most 1, a change δξ_i moves the end of
/// section i by at most |δξ_i| L_i/2 and turns what follows by at most |δξ_i|. A point at fraction σ of section k
/// therefore moves by at most Σ_{i<k} |δξ_i| (L_i/2 + Σ_{i<j<k} L_j + σ L_k) + |δξ_k| L_k σ²/2, which grows with σ:
/// the bounds are those at σ = 1.
fn displacements(robot: &Robot, turns: [f64; SECTIONS]) -> [f64; SECTIONS] {
    let (mut swept, mut turned) = (0.0, 0.0);
    std::array::from_fn(|k| {
        let length = robot.section_lengths[k];
        swept += turned * length + turns[k] * (0.5 * length);
        turned += turns[k];
        swept
    })
}

/// Bounds on how the three bending pairs turn during an interval of time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct MotionBound {
    /// Lengths of the bending pairs' paths, rad.
    turns: [f64; SECTIONS],
    /// Largest rates of the bending pairs, rad/s.
    rates: [f64; SECTIONS],
    /// Largest accelerations of the bending pairs, rad/s²; infinite where the curve has a corner.
    accelerations: [f64; SECTIONS],
    /// Length of the interval, s.
    pub(crate) duration: f64,
}

impl MotionBound {
    /// No motion, in no time.
    pub(crate) const REST: Self = Self {
        turns: [0.0; SECTIONS],
        rates: [0.0; SECTIONS],
        accelerations: [0.0; SECTIONS],
        duration: 0.0,
    };

    /// The bounds for one curve, from the control values of its derivatives, whose convex hulls it stays in.
    ///
    /// A Bézier curve is never longer than its control polygon.
    pub(crate) fn of_curve(curve: &QuinticSegment) -> Self {
        let control = &curve.control;
        let steps: [Configuration; 5] = std::array::from_fn(|i| control[i + 1] - control[i]);
        let (mut lengths, mut longest) = ([0.0; SECTIONS], [0.0; SECTIONS]);
        for step in &steps {
            let turns = turns(step);
            lengths = add(lengths, turns);
            longest = larger(longest, turns);
        }
        let mut bend = [0.0; SECTIONS];
        for pair in steps.windows(2) {
            bend = larger(bend, squared_turns(&(pair[1] - pair[0])));
        }
        let rate = 5.0 / curve.duration;
        Self {
            turns: lengths,
            rates: longest.map(|step| step * rate),
            accelerations: bend.map(|step| step.sqrt() * (0.8 * rate * rate)),
            duration: curve.duration,
        }
    }

    /// The bounds for a straight move between two configurations at constant speed, in unit time.
    pub(crate) fn of_edge(a: &Configuration, b: &Configuration) -> Self {
        let turns = turns(&(b - a));
        Self {
            turns,
            rates: turns,
            accelerations: [0.0; SECTIONS],
            duration: 1.0,
        }
    }

    /// The bounds for any part of a straight move at constant speed that takes this share of its time.
    pub(crate) fn part(&self, share: f64) -> Self {
        Self {
            turns: self.turns.map(|turn| turn * share),
            duration: self.duration * share,
            ..*self
        }
    }

    /// The bounds for successive intervals together, where the curve is smooth between them.
    pub(crate) fn of_successive(bounds: &[Self]) -> Self {
        bounds.iter().fold(Self::REST, Self::then)
    }

    /// The bounds for this interval and the one after it, where the curve is smooth between the two.
    fn then(self, next: &Self) -> Self {
        Self {
            turns: add(self.turns, next.turns),
            rates: larger(self.rates, next.rates),
            accelerations: larger(self.accelerations, next.accelerations),
            duration: self.duration + next.duration,
        }
    }

    /// These bounds for a curve that may have a corner somewhere.
    pub(crate) fn with_corner(self) -> Self {
        Self {
            accelerations: [f64::INFINITY; SECTIONS],
            ..self
        }
    }

    /// How far the body's points stray from their chords, by section.
    ///
    /// With ω the angular velocity of the tangent e at a place of the backbone, T = Σ |ξ_i′| and A = Σ |ξ_i″| over the
    /// sections up to it (its own in proportion to the fraction), |ω| ≤ T and |ω′| ≤ A + T²/2, since a right Jacobian of
    /// SO(3) changes by at most |ξ_i′|/2. So |e″| ≤ |ω′| + |ω|² ≤ A + 3T²/2, a point's acceleration is at most its
    /// integral along the backbone, and the point is within duration²/8 of that from where its chord is at that time.
    fn deviation(&self, robot: &Robot) -> [f64; SECTIONS] {
        let (mut rate, mut acceleration, mut integral) = (0.0, 0.0, 0.0);
        let eighth = 0.125 * self.duration * self.duration;
        std::array::from_fn(|k| {
            let (r, a) = (self.rates[k], self.accelerations[k]);
            let squared_rate = rate * rate + r * (rate + r / 3.0);
            integral += robot.section_lengths[k] * (1.5 * squared_rate + acceleration + 0.5 * a);
            rate += r;
            acceleration += a;
            eighth * integral
        })
    }

    /// Bounds on the distances between the places of the body's points at both ends of the interval, by section.
    ///
    /// Along a section a point's place has the second derivative L R (ξ × e₃), R the rotation up to it, so the difference
    /// of two places is at most that of the section's ends plus L/8 (|Δξ_k| + |ξ_k| T), T the turns up to the section's end.
    fn chords(&self, robot: &Robot, from: &BackbonePose, to: &BackbonePose) -> [f64; SECTIONS] {
        let (mut before, mut turned) = (0.0_f64, 0.0);
        std::array::from_fn(|k| {
            turned += self.turns[k];
            let bow = robot.section_lengths[k] * (self.turns[k] + from.bends[k] * turned);
            let after = (to.joints[k] - from.joints[k]).norm();
            let chord = before.max(after) + 0.125 * bow;
            before = after;
            chord
        })
    }

    /// Bounds on the paths of the body's points between two poses while the bending pairs turn within these bounds.
    pub(crate) fn sweep(&self, robot: &Robot, from: &BackbonePose, to: &BackbonePose) -> Sweep {
        let path_lengths = displacements(robot, self.turns);
        let chords = self.chords(robot, from, to);
        Sweep {
            path_lengths,
            chords: std::array::from_fn(|k| chords[k].min(path_lengths[k])),
            deviation: self.deviation(robot),
        }
    }
}

/// Bounds on the paths of the body's points during an interval, by section.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sweep {
    /// Lengths of the points' paths.
    path_lengths: [f64; SECTIONS],
    /// Distances between a point's places at both ends.
    chords: [f64; SECTIONS],
    /// Distances from the places that a constant velocity between the same ends would lead to.
    deviation: [f64; SECTIONS],
}

/// Where the backbone is at an end of an interval.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BackbonePose {
    /// Ends of the sections.
    joints: [Point; SECTIONS],
    /// Bending angles, rad.
    bends: [f64; SECTIONS],
}

impl BackbonePose {
    pub(crate) fn new(configuration: &Configuration, backbone: &Backbone) -> Self {
        let frames = backbone.frames();
        Self {
            joints: std::array::from_fn(|k| frames[k + 1].position),
            bends: turns(configuration),
        }
    }
}

impl Sweep {
    /// A lower bound of a section's clearance during the interval, from those at its two ends.
    ///
    /// `reach` is the sum of the tube's radius and the least radius of all obstacles, `obstacle_path` how far the obstacles
    /// move themselves, at constant velocity.
    pub(crate) fn lowest(
        &self,
        k: usize,
        [from, to]: [f64; 2],
        reach: f64,
        obstacle_path: f64,
    ) -> f64 {
        let passage = Passage {
            path_length: self.path_lengths[k] + obstacle_path,
            chord: self.chords[k] + obstacle_path,
            stray: self.deviation[k],
            reach,
        };
        passage.lowest(from, to)
    }
}

fn squared_turns(change: &Configuration) -> [f64; SECTIONS] {
    std::array::from_fn(|i| {
        let (x, y) = (change[2 * i], change[2 * i + 1]);
        x * x + y * y
    })
}

/// Norm of each bending pair.
fn turns(change: &Configuration) -> [f64; SECTIONS] {
    squared_turns(change).map(f64::sqrt)
}

fn add(a: [f64; SECTIONS], b: [f64; SECTIONS]) -> [f64; SECTIONS] {
    std::array::from_fn(|i| a[i] + b[i])
}

fn larger(a: [f64; SECTIONS], b: [f64; SECTIONS]) -> [f64; SECTIONS] {
    std::array::from_fn(|i| a[i].max(b[i]))
}

/// Padding of each section's tube so that a body within `path_tolerance_rad` (each bending pair) of the path stays inside:
/// little near the base, which an error moves least.
#[must_use]
pub fn tracking_padding(robot: &Robot, path_tolerance_rad: f64) -> [f64; SECTIONS] {
    displacements(robot, [path_tolerance_rad; SECTIONS])
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;
    use trajectory::Knot;

    fn uneven_robot() -> Robot {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../config/robots/unit.toml");
        Robot {
            section_lengths: [1.0, 0.7, 1.3],
            ..Robot::from_file(file.as_ref()).unwrap()
        }
    }

    #[test]
    fn no_body_point_moves_further_than_the_bound() {
        let (robot, mut random) = (uneven_robot(), Pcg64::seed_from_u64(2));
        let mut tightest: f64 = 0.0;
        for i in 0..20_000 {
            let mut vector =
                |size: f64| Configuration::from_fn(|_, _| random.random_range(-size..=size));
            let (a, mut step) = (vector(1.1), vector(0.4));
            if i % 2 == 0 {
                let component = i / 2 % 6;
                step =
                    Configuration::from_fn(|row, _| if row == component { step[row] } else { 0.0 });
            }
            let bound = displacements(&robot, turns(&step));
            let (from, to) = (robot.backbone(&a), robot.backbone(&(a + step)));
            for (section, bound) in bound.into_iter().enumerate().filter(|(_, b)| *b > 0.0) {
                let fraction = [1.0, random.random()][i / 12 % 2];
                let moved = (to.point(section, fraction) - from.point(section, fraction)).norm();
                assert!(moved <= bound * (1.0 + 1e-12));
                tightest = tightest.max(moved / bound);
            }
        }
        assert!(tightest > 0.99, "a bound that is never met: {tightest}");
    }

    #[test]
    fn the_bound_is_exact_to_first_order_where_a_straight_robot_begins_to_bend() {
        let robot = uneven_robot();
        let (straight, mut bent) = (Configuration::zeros(), Configuration::zeros());
        bent[1] = 1e-6;
        let bound = displacements(&robot, turns(&bent));
        for (section, expected) in [0.5e-6, 1.2e-6, 2.5e-6].into_iter().enumerate() {
            let [from, to] = [&straight, &bent].map(|q| robot.backbone(q).point(section, 1.0));
            assert!((bound[section] - expected).abs() < 1e-18);
            assert!(((to - from).norm() - expected).abs() < 1e-15);
        }
    }

    #[test]
    fn no_chord_is_longer_and_no_body_point_strays_further_from_it_than_the_bounds() {
        let (robot, mut random) = (uneven_robot(), Pcg64::seed_from_u64(1));
        let (mut tightest, mut tightest_chord) = (0.0_f64, 0.0_f64);
        for i in 0..2_000 {
            let duration = random.random_range(0.1..3.0);
            let mut vector =
                |size: f64| Configuration::from_fn(|_, _| random.random_range(-size..=size));
            let bend = [0.0, 0.3][i % 2];
            let (position, velocity) = (vector(1.0), vector(0.5));
            let [from, to] = [0.0, duration].map(|time| Knot {
                time,
                position: position + velocity * time + vector(bend),
                velocity: velocity + vector(bend),
                acceleration: vector(bend),
            });
            let curve = QuinticSegment::between(&from, &to);
            let (first, second) = curve.halves();
            let whole = MotionBound::of_curve(&curve);
            let joined = MotionBound::of_curve(&first).then(&MotionBound::of_curve(&second));
            let (deviation, of_whole) = (joined.deviation(&robot), whole.deviation(&robot));
            assert!(deviation[2] <= of_whole[2] * (1.0 + 1e-9));
            let backbone = |u: f64| robot.backbone(&curve.evaluate(u * duration).position);
            let (a, b) = (backbone(0.0), backbone(1.0));
            let pose =
                |u: f64| BackbonePose::new(&curve.evaluate(u * duration).position, &backbone(u));
            let chords = joined.chords(&robot, &pose(0.0), &pose(1.0));
            for k in 0..SECTIONS {
                let fraction = [1.0, random.random()][i % 2];
                let point = |u: f64| backbone(u).point(k, fraction);
                let (a, b) = (a.point(k, fraction), b.point(k, fraction));
                for u in [0.2, 0.5, 0.7] {
                    let strayed = (point(u) - a.lerp(&b, u)).norm();
                    assert!(strayed <= deviation[k] + 1e-12, "{strayed} {deviation:?}");
                    tightest = tightest.max(strayed / deviation[k]);
                }
                assert!((b - a).norm() <= chords[k], "{chords:?}");
                tightest_chord = tightest_chord.max((b - a).norm() / chords[k]);
            }
        }
        assert!(tightest > 0.3, "far too wide a bound: {tightest}");
        assert!(tightest_chord > 0.8, "far too wide: {tightest_chord}");
    }

    #[test]
    fn the_bound_is_the_height_of_the_triangle_and_not_below_the_linear_one() {
        let sweep = |path: f64, deviation: f64| Sweep {
            path_lengths: [path; 3],
            chords: [path; 3],
            deviation: [deviation; 3],
        };
        let lowest =
            |path, deviation, from, to| sweep(path, deviation).lowest(0, [from, to], 0.4, 0.0);
        let expected = (0.25_f64 - 0.01).sqrt() - 0.4;
        assert!((lowest(0.2, 0.0, 0.1, 0.1) - expected).abs() < 1e-15);
        assert!((lowest(0.2, 0.01, 0.1, 0.1) - expected + 0.01).abs() < 1e-15);
        assert_eq!(lowest(0.2, 5.0, 0.1, 0.1), 0.0);
        assert_eq!(lowest(0.2, f64::INFINITY, 0.1, 0.1), 0.0);
        assert!(
            (lowest(0.2, 0.0, 0.3, 0.1) - 0.1).abs() < 1e-15,
            "straight at it"
        );
        assert_eq!(lowest(0.0, 0.0, 0.1, 0.1), 0.1);
        assert!((lowest(0.2, 0.0, -0.5, -0.5) + 0.6).abs() < 1e-15);
        assert!(lowest(f64::NAN, 0.0, 0.1, 0.1).is_nan());
    }
}
