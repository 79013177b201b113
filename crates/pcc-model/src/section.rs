//! One section: a circular arc as a function of its bending pair, regular at zero.

use nalgebra::{Matrix3, Vector3};

/// Below this squared angle the series are used; their truncation error is below 1e-17 there.
const SERIES_BELOW: f64 = 1e-3;

/// A = sin θ/θ, B = (1 − cos θ)/θ², and their derivatives with respect to s = θ².
#[derive(Clone, Copy, Debug)]
pub(crate) struct Coefficients {
    pub(crate) a: f64,
    pub(crate) b: f64,
    pub(crate) da: f64,
    pub(crate) db: f64,
}

impl Coefficients {
    pub(crate) fn at(s: f64) -> Self {
        if s < SERIES_BELOW {
            Self::series(s)
        } else {
            Self::closed(s)
        }
    }

    fn series(s: f64) -> Self {
        Self {
            a: 1.0 - s / 6.0 * (1.0 - s / 20.0 * (1.0 - s / 42.0 * (1.0 - s / 72.0))),
            b: 0.5 * (1.0 - s / 12.0 * (1.0 - s / 30.0 * (1.0 - s / 56.0 * (1.0 - s / 90.0)))),
            da: -1.0 / 6.0
                * (1.0 - s / 10.0 * (1.0 - s / 28.0 * (1.0 - s / 54.0 * (1.0 - s / 88.0)))),
            db: -1.0 / 24.0
                * (1.0 - s / 15.0 * (1.0 - s / 37.333_333_333_333_336 * (1.0 - s / 67.5))),
        }
    }

    fn closed(s: f64) -> Self {
        let theta = s.sqrt();
        let half = (0.5 * theta).sin();
        let a = theta.sin() / theta;
        let b = 2.0 * half * half / s;
        Self {
            a,
            b,
            da: (theta.cos() - a) / (2.0 * s),
            db: (0.5 * a - b) / s,
        }
    }
}

/// Rotation over a section (or a part of one) with bending pair `(x, y)`: I + A ŵ + B ŵ², w = (x, y, 0).
pub(crate) fn rotation(x: f64, y: f64, c: &Coefficients) -> Matrix3<f64> {
    let (xx, yy, xy) = (c.b * x * x, c.b * y * y, c.b * x * y);
    Matrix3::new(
        1.0 - yy,
        xy,
        c.a * y,
        xy,
        1.0 - xx,
        -c.a * x,
        -c.a * y,
        c.a * x,
        1.0 - xx - yy,
    )
}

/// Position at the end of a section of length `l`: l (B y, −B x, A).
pub(crate) fn position(x: f64, y: f64, l: f64, c: &Coefficients) -> Vector3<f64> {
    Vector3::new(c.b * y, -c.b * x, c.a) * l
}

/// Derivatives of [`position`] with respect to `x` and `y`.
pub(crate) fn position_derivatives(x: f64, y: f64, l: f64, c: &Coefficients) -> [Vector3<f64>; 2] {
    let by_x = Vector3::new(
        2.0 * x * c.db * y,
        -c.b - 2.0 * x * c.db * x,
        2.0 * x * c.da,
    );
    let by_y = Vector3::new(
        c.b + 2.0 * y * c.db * y,
        -2.0 * y * c.db * x,
        2.0 * y * c.da,
    );
    [by_x * l, by_y * l]
}

/// Angular velocities (in the section's base frame) that changes of `x` and `y` give to its end:
/// the columns of the left Jacobian I + B ŵ + (1 − A)/θ² ŵ² of SO(3).
pub(crate) fn angular_derivatives(x: f64, y: f64, c: &Coefficients) -> [Vector3<f64>; 2] {
    let s = x * x + y * y;
    let q = if s < SERIES_BELOW {
        (1.0 - s / 20.0 * (1.0 - s / 42.0 * (1.0 - s / 72.0))) / 6.0
    } else {
        (1.0 - c.a) / s
    };
    let by_x = Vector3::new(1.0 - q * y * y, q * x * y, -c.b * y);
    let by_y = Vector3::new(q * x * y, 1.0 - q * x * x, c.b * x);
    [by_x, by_y]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn series_and_closed_form_agree_where_they_meet() {
        let (series, closed) = (
            Coefficients::series(SERIES_BELOW),
            Coefficients::closed(SERIES_BELOW),
        );
        assert!((series.a - closed.a).abs() < 1e-15);
        assert!((series.b - closed.b).abs() < 1e-13);
        assert!((series.da - closed.da).abs() < 1e-12);
        assert!((series.db - closed.db).abs() < 1e-9);
    }
}
