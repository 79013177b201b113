//! The reference's own criterion of collision: nine points of the backbone, three a section, against the balls.

use super::kinematics::{Arc, Shapes, Vector, add, dot, rotate, subtract};
use super::lanes::Lanes;
use collision::Ball;
use pcc_model::SECTIONS;

/// Fractions of each section that are looked at.
pub(super) const FRACTIONS: [f64; 3] = [1.0 / 3.0, 2.0 / 3.0, 1.0];
/// Points looked at.
const POINTS: usize = SECTIONS * FRACTIONS.len();

/// The nine points of eight shapes, from the base on.
#[inline(always)]
fn points(lengths: &[f64; SECTIONS], shapes: &Shapes) -> [Vector; POINTS] {
    let zero = Lanes::splat(0.0);
    let mut out = [[zero; 3]; POINTS];
    let parts = |i: usize| {
        FRACTIONS.map(|f| Arc::new(shapes[2 * i] * f, shapes[2 * i + 1] * f, lengths[i] * f))
    };
    let [first, second, third] = [parts(0), parts(1), parts(2)];
    let (first_turn, second_turn) = (first[2].rotation(), second[2].rotation());
    let (first_end, second_end) = (first[2].end(), second[2].end());
    for k in 0..FRACTIONS.len() {
        out[k] = first[k].end();
        out[3 + k] = add(&first_end, &rotate(&first_turn, &second[k].end()));
        let in_first = add(&second_end, &rotate(&second_turn, &third[k].end()));
        out[6 + k] = add(&first_end, &rotate(&first_turn, &in_first));
    }
    out
}

/// Smallest distance of the nine points of eight shapes to the balls' surfaces; +∞ without balls.
#[inline(always)]
pub(super) fn distances(lengths: &[f64; SECTIONS], balls: &[Ball], shapes: &Shapes) -> Lanes {
    let points = points(lengths, shapes);
    let mut nearest = Lanes::splat(f64::INFINITY);
    for ball in balls {
        let mut squared = Lanes::splat(f64::INFINITY);
        for point in &points {
            squared = squared.min(squared_distance(point, ball));
        }
        nearest = nearest.min(squared.sqrt() - Lanes::splat(ball.radius));
    }
    nearest
}

/// The deepest of the nine points of each of eight shapes.
pub(super) struct Deepest {
    /// Its distance to the ball's surface.
    pub(super) distance: Lanes,
    /// Point × number of balls + ball.
    code: Lanes,
    balls: usize,
}

impl Deepest {
    /// Section, fraction of it, and index of the ball, of one lane.
    pub(super) fn of(&self, lane: usize) -> (usize, f64, usize) {
        let code = self.code.0[lane] as usize;
        let (point, ball) = (code / self.balls, code % self.balls);
        let per_section = FRACTIONS.len();
        (point / per_section, FRACTIONS[point % per_section], ball)
    }
}

/// Finds the deepest of the nine points of eight shapes; `balls` must not be empty.
#[inline(always)]
pub(super) fn deepest(lengths: &[f64; SECTIONS], balls: &[Ball], shapes: &Shapes) -> Deepest {
    let points = points(lengths, shapes);
    let mut distance = Lanes::splat(f64::INFINITY);
    let mut code = Lanes::splat(0.0);
    for (k, point) in points.iter().enumerate() {
        for (b, ball) in balls.iter().enumerate() {
            let here = squared_distance(point, ball).sqrt() - Lanes::splat(ball.radius);
            let name = Lanes::splat((k * balls.len() + b) as f64);
            code = here.choose_below(distance, name, code);
            distance = distance.min(here);
        }
    }
    Deepest {
        distance,
        code,
        balls: balls.len(),
    }
}

#[inline(always)]
fn squared_distance(point: &Vector, ball: &Ball) -> Lanes {
    let centre = [0, 1, 2].map(|axis| Lanes::splat(ball.centre[axis]));
    let from_centre = subtract(point, &centre);
    dot(&from_centre, &from_centre)
}
