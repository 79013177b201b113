//! The canonical frame: the goal's azimuth about the base axis is zero (docs/robot.md "Symmetry").

use collision::Ball;
use denoiser::FeatureFrame;
use pcc_model::{Configuration, Point, UnitRobot};

/// Below this distance from the axis an azimuth is not defined, section lengths.
const AXIS_RADIUS: f64 = 1e-6;

/// A rotation about base z, then optionally the mirror y → −y, into the frame the model was trained in.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CanonicalFrame {
    cosine: f64,
    sine: f64,
    mirror: f64,
}

impl CanonicalFrame {
    /// The base frame, left as it is.
    const BASE: Self = Self {
        cosine: 1.0,
        sine: 0.0,
        mirror: 1.0,
    };

    /// The frame that a model wants its features in.
    pub(crate) fn wanted(
        frame: FeatureFrame,
        robot: &UnitRobot,
        start: &Configuration,
        goal_tip: &Point,
    ) -> Self {
        match frame {
            FeatureFrame::Canonical => Self::of(robot, start, goal_tip),
            FeatureFrame::Base => Self::BASE,
        }
    }

    /// The frame in which the goal tip, else the start tip, has azimuth zero.
    pub(crate) fn of(robot: &UnitRobot, start: &Configuration, goal_tip: &Point) -> Self {
        let azimuth = azimuth(goal_tip)
            .or_else(|| azimuth(&robot.tip(start)))
            .unwrap_or(0.0);
        Self {
            cosine: azimuth.cos(),
            sine: azimuth.sin(),
            mirror: 1.0,
        }
    }

    /// This frame mirrored: the augmentation of the training data.
    pub(super) fn mirrored(self) -> Self {
        Self {
            mirror: -self.mirror,
            ..self
        }
    }

    pub(crate) fn point(&self, p: &Point) -> Point {
        Point::new(
            self.cosine * p.x + self.sine * p.y,
            self.mirror * (self.cosine * p.y - self.sine * p.x),
            p.z,
        )
    }

    pub(crate) fn ball(&self, ball: &Ball) -> Ball {
        Ball {
            centre: self.point(&ball.centre),
            radius: ball.radius,
        }
    }

    /// A configuration of the base frame, in this frame. Bending pairs are axial vectors: they rotate with the frame and change sign in
    /// x under the mirror.
    pub(crate) fn configuration(&self, q: &Configuration) -> Configuration {
        pairs(q, |a, b| {
            (
                self.mirror * (self.cosine * a + self.sine * b),
                self.cosine * b - self.sine * a,
            )
        })
    }

    /// A configuration of the canonical frame, in the base frame.
    pub(crate) fn restore(&self, q: &Configuration) -> Configuration {
        pairs(q, |a, b| {
            let a = self.mirror * a;
            (
                self.cosine * a - self.sine * b,
                self.sine * a + self.cosine * b,
            )
        })
    }
}

fn pairs(q: &Configuration, turn: impl Fn(f64, f64) -> (f64, f64)) -> Configuration {
    let mut turned = *q;
    for i in (0..q.len()).step_by(2) {
        (turned[i], turned[i + 1]) = turn(q[i], q[i + 1]);
    }
    turned
}

fn azimuth(p: &Point) -> Option<f64> {
    (p.x.hypot(p.y) >= AXIS_RADIUS).then(|| p.y.atan2(p.x))
}
