//! The reference's own criterion of collision: nine points of the backbone, three a section, against the balls.

use super::kinematics::{Arc, Shape, Vector, add, rotate};
use collision::Ball;
use fearless_simd::{Level, dispatch};
use pcc_model::{DOF, SECTIONS};
use planning::sampled_collision::FRACTIONS;

/// Points looked at.
const POINTS: usize = SECTIONS * FRACTIONS.len();

/// The deepest of the nine points of each of N shapes.
pub(super) struct Samples<const N: usize> {
    points: [[[f64; N]; 3]; POINTS],
    /// Distance of each shape's deepest point to its ball's surface; +∞ without balls.
    pub(super) distances: [f64; N],
    /// Number of each shape's deepest point, from the base on.
    points_of: [f64; N],
    /// Index of the ball of each shape's deepest point.
    balls_of: [f64; N],
}

impl<const N: usize> Samples<N> {
    pub(super) fn new() -> Self {
        Self {
            points: [[[0.0; N]; 3]; POINTS],
            distances: [f64::INFINITY; N],
            points_of: [0.0; N],
            balls_of: [0.0; N],
        }
    }

    /// Looks at N shapes, given component by component.
    pub(super) fn look(
        &mut self,
        lengths: &[f64; SECTIONS],
        balls: &[Ball],
        components: [&[f64]; DOF],
    ) {
        self.distances = [f64::INFINITY; N];
        if !balls.is_empty() {
            dispatch!(Level::new(), _ => self.find_deepest(lengths, balls, components));
        }
    }

    #[inline(always)]
    fn find_deepest(
        &mut self,
        lengths: &[f64; SECTIONS],
        balls: &[Ball],
        components: [&[f64]; DOF],
    ) {
        place_points(lengths, components, &mut self.points);
        for (b, ball) in balls.iter().enumerate() {
            look_at(ball, b as f64, self);
        }
    }

    /// Section, fraction of it, and index of the ball, where shape i is deepest.
    pub(super) fn deepest(&self, i: usize) -> (usize, f64, usize) {
        let (point, per_section) = (self.points_of[i] as usize, FRACTIONS.len());
        let ball = self.balls_of[i] as usize;
        (point / per_section, FRACTIONS[point % per_section], ball)
    }
}

#[inline(always)]
fn place_points<const N: usize>(
    lengths: &[f64; SECTIONS],
    components: [&[f64]; DOF],
    points: &mut [[[f64; N]; 3]; POINTS],
) {
    let [c0, c1, c2, c3, c4, c5] = components;
    let [c0, c1, c2, c3, c4, c5] = [&c0[..N], &c1[..N], &c2[..N], &c3[..N], &c4[..N], &c5[..N]];
    for i in 0..N {
        let nine = nine_points(lengths, &[c0[i], c1[i], c2[i], c3[i], c4[i], c5[i]]);
        for k in 0..POINTS {
            for axis in 0..3 {
                points[k][axis][i] = nine[k][axis];
            }
        }
    }
}

/// Takes over, where it is deeper than what was found before, the deepest of the nine points in one ball.
#[inline(always)]
fn look_at<const N: usize>(ball: &Ball, name: f64, samples: &mut Samples<N>) {
    let (mut nearest, mut nearest_point) = ([f64::INFINITY; N], [0.0; N]);
    let centre = [ball.centre.x, ball.centre.y, ball.centre.z];
    for (k, [xs, ys, zs]) in samples.points.iter().enumerate() {
        for i in 0..N {
            let (x, y, z) = (xs[i] - centre[0], ys[i] - centre[1], zs[i] - centre[2]);
            let squared = x * x + y * y + z * z;
            let is_nearer = squared < nearest[i];
            nearest[i] = select(is_nearer, squared, nearest[i]);
            nearest_point[i] = select(is_nearer, k as f64, nearest_point[i]);
        }
    }
    for i in 0..N {
        let distance = nearest[i].sqrt() - ball.radius;
        let is_deeper = distance < samples.distances[i];
        samples.distances[i] = select(is_deeper, distance, samples.distances[i]);
        samples.points_of[i] = select(is_deeper, nearest_point[i], samples.points_of[i]);
        samples.balls_of[i] = select(is_deeper, name, samples.balls_of[i]);
    }
}

/// One of two values; a function, since a closure would not be compiled for the processor's vector instructions.
#[inline(always)]
fn select(is_first: bool, first: f64, second: f64) -> f64 {
    if is_first { first } else { second }
}

/// The nine points of a shape, from the base on.
#[inline(always)]
fn nine_points(lengths: &[f64; SECTIONS], shape: &Shape) -> [Vector; POINTS] {
    let first = Arc::new(shape[0], shape[1], lengths[0]);
    let second = Arc::new(shape[2], shape[3], lengths[1]);
    let (first_turn, second_turn) = (first.rotation(), second.rotation());
    let (first_end, second_end) = (first.end(), second.end());
    let mut out = [[0.0; 3]; POINTS];
    for (k, f) in FRACTIONS.into_iter().enumerate() {
        let part = |i: usize| Arc::new(shape[2 * i] * f, shape[2 * i + 1] * f, lengths[i] * f);
        out[k] = part(0).end();
        out[3 + k] = add(&first_end, &rotate(&first_turn, &part(1).end()));
        let in_first = add(&second_end, &rotate(&second_turn, &part(2).end()));
        out[6 + k] = add(&first_end, &rotate(&first_turn, &in_first));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::unit_robot;
    use crate::scenes::reference_layout;
    use pcc_model::Configuration;
    use planning::random_configuration;
    use rand::SeedableRng;
    use rand_pcg::Pcg64;

    #[test]
    fn the_deepest_point_is_the_one_of_the_backbone() {
        let (robot, balls) = (unit_robot(), reference_layout(4));
        let mut rng = Pcg64::seed_from_u64(1);
        let shapes: [Configuration; 8] =
            std::array::from_fn(|_| random_configuration(&robot, &mut rng));
        let components: [[f64; 8]; DOF] =
            std::array::from_fn(|d| std::array::from_fn(|i| shapes[i][d]));
        let mut samples = Samples::<8>::new();
        samples.look(
            &robot.section_lengths,
            &balls,
            components.each_ref().map(|c| &c[..]),
        );
        for (i, shape) in shapes.iter().enumerate() {
            let backbone = robot.backbone(shape);
            let distance = |section: usize, fraction: f64, ball: &Ball| {
                (backbone.point(section, fraction) - ball.centre).norm() - ball.radius
            };
            let mut nearest = f64::INFINITY;
            for (section, fraction) in (0..3).flat_map(|s| FRACTIONS.map(|f| (s, f))) {
                for ball in &balls {
                    nearest = nearest.min(distance(section, fraction, ball));
                }
            }
            let (section, fraction, ball) = samples.deepest(i);
            assert!((samples.distances[i] - nearest).abs() < 1e-12);
            assert!((distance(section, fraction, &balls[ball]) - nearest).abs() < 1e-12);
        }
    }

    #[test]
    fn nothing_is_near_without_balls() {
        let mut samples = Samples::<2>::new();
        samples.look(&[1.0; SECTIONS], &[], [&[0.0; 2]; DOF]);
        assert_eq!(samples.distances, [f64::INFINITY; 2]);
    }
}
