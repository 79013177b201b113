//! What moves in the fourth experiment: a target on a circle, and a ball that crosses its way.

use pcc_model::Point;
use shared_types::message::MovingBall;
use std::f64::consts::TAU;
use std::ops::Range;

/// The circle's middle in section lengths, and its half axes: across, along y, and in height.
const MIDDLE: [f64; 3] = [0.7, 0.0, 2.2];
const HALF_AXES: [f64; 3] = [0.4, 0.5, 0.15];
/// Time of one turn, after which the target rests, s.
pub(super) const TURN_S: f64 = 8.0;
/// Radius of the ball, where it is at [`PASSES_S`], and its velocity: section lengths, and section lengths/s.
const RADIUS: f64 = 0.1;
const PASSED: [f64; 3] = [0.95, -0.5, 2.2];
const VELOCITY: [f64; 3] = [0.0, 0.0, -0.5];
/// When the ball passes the circle, s.
const PASSES_S: f64 = 6.2;
/// When there is a ball, s.
pub(super) const SEEN_S: Range<f64> = 2.0..7.8;

/// The target and the ball, in metres; times are seconds after the target has begun to move.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moving {
    length_m: f64,
}

impl Moving {
    /// For a robot with sections of this length.
    pub(super) fn new(length_m: f64) -> Self {
        Self { length_m }
    }

    /// Where the target is.
    pub(super) fn target_m(&self, time_s: f64) -> [f64; 3] {
        let (sine, cosine) = angle(time_s.clamp(0.0, TURN_S)).sin_cos();
        let offset = [cosine, sine, cosine];
        std::array::from_fn(|axis| self.length_m * (MIDDLE[axis] + HALF_AXES[axis] * offset[axis]))
    }

    /// Its velocity, m/s.
    pub(super) fn target_velocity_m_s(&self, time_s: f64) -> [f64; 3] {
        if !(0.0..TURN_S).contains(&time_s) {
            return [0.0; 3];
        }
        let (sine, cosine) = angle(time_s).sin_cos();
        let rate = TAU / TURN_S;
        let direction = [-sine, cosine, -sine];
        std::array::from_fn(|axis| self.length_m * HALF_AXES[axis] * rate * direction[axis])
    }

    /// Distance of a tip to the target, m.
    pub(super) fn error_m(&self, time_s: f64, tip_m: &Point) -> f64 {
        (tip_m - Point::from(self.target_m(time_s))).norm()
    }

    /// The ball, while there is one.
    pub(super) fn ball(&self, time_s: f64) -> Option<MovingBall> {
        let since_s = time_s - PASSES_S;
        let centre = |axis: usize| PASSED[axis] + since_s * VELOCITY[axis];
        SEEN_S.contains(&time_s).then(|| MovingBall {
            centre_m: std::array::from_fn(|axis| self.length_m * centre(axis)),
            radius_m: self.length_m * RADIUS,
            velocity_m_s: VELOCITY.map(|part| self.length_m * part),
        })
    }
}

fn angle(time_s: f64) -> f64 {
    TAU * time_s / TURN_S
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_target_returns_to_where_it_began_and_rests() {
        let moving = Moving::new(2.0);
        assert_eq!(moving.target_m(0.0), [2.2, 0.0, 4.7]);
        let end = Point::from(moving.target_m(TURN_S));
        assert!(moving.error_m(0.0, &end) < 1e-12);
        assert_eq!(moving.target_m(TURN_S), moving.target_m(TURN_S + 3.0));
        assert_eq!(moving.target_velocity_m_s(TURN_S), [0.0; 3]);
    }

    #[test]
    fn velocities_are_those_of_the_places() {
        let (moving, step_s) = (Moving::new(0.5), 1e-6);
        for time_s in [0.5, 2.7, 4.4, 6.1] {
            let moved = Point::from(moving.target_m(time_s + step_s));
            let target = Point::from(moving.target_velocity_m_s(time_s)) * step_s;
            let expected = Point::from(moving.target_m(time_s)) + target;
            assert!((moved - expected).norm() < 1e-10);
        }
        let [before, after] = [4.0, 5.0].map(|time_s| moving.ball(time_s).unwrap());
        let way = Point::from(after.centre_m) - Point::from(before.centre_m);
        assert!((way - Point::from(before.velocity_m_s)).norm() < 1e-12);
        assert_eq!(moving.ball(SEEN_S.end).map(|ball| ball.radius_m), None);
    }
}
