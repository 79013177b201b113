//! The exact nearest point of a circular arc (docs/robot.md "Exact geometry of a section").

use crate::Point;
use fearless_simd::f64x4;
use fearless_simd::prelude::*;

/// The point of a section that is nearest to another point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// Distance between the two points, length unit.
    pub distance: f64,
    /// Where along the section, 0 at its base to 1 at its end.
    pub fraction: f64,
    /// The point of the section, base frame.
    pub point: Point,
}

/// Distance from a point to the circle that the arc lies on, in the section's base frame; no cancellation at κ = 0.
///
/// `along` is the coordinate in the bending direction, `out` the one out of the plane, `z` along the base tangent.
pub(crate) fn distance_to_circle(curvature: f64, along: f64, out: f64, z: f64) -> f64 {
    let (sine, cosine) = (curvature * z, curvature * along - 1.0);
    let radial = (cosine * cosine + sine * sine).sqrt() + 1.0;
    let in_plane = (curvature * (along * along + z * z) - 2.0 * along) / radial;
    (in_plane * in_plane + out * out).sqrt()
}

/// Squared distances of four points, in the section's base frame, to the circle that the arc lies on; coordinates as for
/// [`distance_to_circle`].
#[inline(always)]
pub(crate) fn squared_distances_to_circle<S: Simd>(
    curvature: f64,
    along: f64x4<S>,
    out: f64x4<S>,
    z: f64x4<S>,
) -> f64x4<S> {
    let (sine, cosine) = (z * curvature, along * curvature - 1.0);
    let radial = (cosine * cosine + sine * sine).sqrt() + 1.0;
    let in_plane = ((along * along + z * z) * curvature - along * 2.0) / radial;
    in_plane * in_plane + out * out
}

/// Arc length from the base to the foot point on the circle: atan2(κz, 1 − κa)/κ, z at κ = 0.
pub(crate) fn foot_arc_length(curvature: f64, along: f64, z: f64) -> f64 {
    let (sine, cosine) = (curvature * z, 1.0 - curvature * along);
    if sine.abs() < 1e-4 * cosine {
        let tangent = sine / cosine;
        return z / cosine * (1.0 - tangent * tangent / 3.0);
    }
    sine.atan2(cosine) / curvature
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn foot_is_continuous_across_the_series() {
        for curvature in [1e-6, 0.3, 1.5] {
            let edge = 1e-4 / curvature;
            let [below, above] = [edge * (1.0 - 1e-9), edge * (1.0 + 1e-9)]
                .map(|z| foot_arc_length(curvature, 0.0, z));
            assert!((below / above - 1.0).abs() < 3e-9);
        }
        assert_eq!(foot_arc_length(0.0, 0.7, 0.4), 0.4);
    }

    #[test]
    fn foot_beyond_a_quarter_turn_is_on_the_far_side() {
        let almost_half_a_turn = foot_arc_length(1.0, 2.0, 1e-6);
        assert!((almost_half_a_turn - std::f64::consts::PI).abs() < 1e-5);
    }

    #[test]
    fn distance_to_a_straight_line_is_the_one_to_the_axis() {
        assert_eq!(distance_to_circle(0.0, 0.3, 0.4, 7.0), 0.5);
    }
}
